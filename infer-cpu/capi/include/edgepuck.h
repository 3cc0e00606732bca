/*
 * Edgepuck: the class of a point cloud by PointNet on a CPU. C99, C++.
 *
 *     EdgepuckClassifier *classifier = NULL;
 *     EdgepuckPrediction found;
 *     EdgepuckStatus status = edgepuck_load("model.safetensors", NULL, &classifier);
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         status = edgepuck_classify(classifier, xyz, n_points, &found);
 *     }
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         puts(edgepuck_class_name(classifier, found.class_index));
 *     } else {
 *         fprintf(stderr, "%s\n", edgepuck_last_error());
 *     }
 *     edgepuck_free(classifier);
 *
 * One classifier serves one thread at a time, whichever; different classifiers
 * have nothing to do with each other. No Rust panic leaves the library; where
 * memory runs out, the process ends.
 */

#ifndef EDGEPUCK_H
#define EDGEPUCK_H

/* Written by cbindgen from infer-cpu/capi/src: change that. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * How a call went. edgepuck_last_error says more.
 */
typedef enum EdgepuckStatus {
  /**
   * It did what was asked.
   */
  EDGEPUCK_STATUS_OK = 0,
  /**
   * A pointer is null, or not aligned as its type needs.
   */
  EDGEPUCK_STATUS_BAD_POINTER = 1,
  /**
   * An option has a value that nothing can be done with, or that the model
   * cannot meet.
   */
  EDGEPUCK_STATUS_BAD_OPTION = 2,
  /**
   * The model file cannot be read, or is not a model.
   */
  EDGEPUCK_STATUS_BAD_MODEL = 3,
  /**
   * The cloud has no points, too many, or a coordinate that is not finite.
   */
  EDGEPUCK_STATUS_BAD_CLOUD = 4,
  /**
   * This machine cannot do it: it lacks instructions, or threads.
   */
  EDGEPUCK_STATUS_UNSUPPORTED = 5,
  /**
   * The network's arithmetic leaves the range of float on this cloud.
   */
  EDGEPUCK_STATUS_OVERFLOW = 6,
  /**
   * The caller's buffer is too short.
   */
  EDGEPUCK_STATUS_BUFFER_TOO_SMALL = 7,
  /**
   * No cloud has been classified yet, or the last could not be.
   */
  EDGEPUCK_STATUS_NO_PREDICTION = 8,
  /**
   * A defect of this library. The classifier is only good for being freed.
   */
  EDGEPUCK_STATUS_INTERNAL = 9,
} EdgepuckStatus;

/**
 * A network ready to classify clouds: made by edgepuck_load, unmade by
 * edgepuck_free.
 */
typedef struct EdgepuckClassifier EdgepuckClassifier;

/**
 * From the packets of a LiDAR to named, tracked objects: made by
 * edgepuck_live_open, unmade by edgepuck_live_close.
 */
typedef struct EdgepuckLive EdgepuckLive;

/**
 * How a classifier computes. Begin with edgepuck_options_default, then change
 * what you like. Choices are words, the same as on infer-cpu's command line;
 * a word that names nothing gives an error that lists those that do.
 */
typedef struct EdgepuckOptions {
  /**
   * What to compute in: "f32", "f32-fc16" (fp32 arithmetic, the weights of
   * vector layers stored in fp16), "f16" or "i8". Null: "f32".
   */
  const char *precision;
  /**
   * The kernels to use, such as "scalar" or "neon". Null: the fastest that
   * this machine runs.
   */
  const char *kernel;
  /**
   * Threads, the caller's among them; 0 counts as 1.
   */
  size_t threads;
  /**
   * Which T-Nets are run: "both", "input", "feature" or "none"; one that is
   * left out counts as the identity. Null: all that the model has.
   */
  const char *t_nets;
  /**
   * Which points the network sees: "all", "first", "random", "fps", "voxel"
   * or "cpl". Null: as in training; the next seven fields are then left at
   * their defaults.
   */
  const char *sampler;
  /**
   * How many points the sampler keeps. 0: 1024.
   */
  size_t points;
  /**
   * What random draws depend on.
   */
  uint64_t seed;
  /**
   * Where "fps" begins: "farthest" (from the centroid) or "first". Null:
   * "farthest".
   */
  const char *fps_start;
  /**
   * Edge of a voxel for "voxel", in the units of a normalised cloud. 0: as
   * fine as points allows.
   */
  double voxel_size;
  /**
   * How "cpl" comes to its number of points: "truncate", "cyclic", "nearest"
   * or "weighted". Null: "cyclic".
   */
  const char *resize;
  /**
   * How often "cpl" may pool again while it has fewer points than asked for.
   */
  size_t passes;
  /**
   * What "cpl" pools: "auto", "own", "stn" or "trunk". Null: "auto".
   */
  const char *front;
  /**
   * How clouds are normalised: "unit-sphere" or "none". Null: as in
   * training.
   */
  const char *normalization;
  /**
   * Drop points that are not finite instead of refusing the cloud.
   */
  bool drop_invalid;
  /**
   * Draws of a random subset whose log-probabilities are averaged; more than
   * 1 needs the sampler "random", or vote_rotations.
   */
  uint32_t votes;
  /**
   * Turn the cloud about its up axis between votes, evenly spread.
   */
  bool vote_rotations;
  /**
   * The axis that points up: 0 for x, 1 for y, 2 for z.
   */
  size_t up;
  /**
   * Points to make room for at once; larger clouds allocate when they come.
   */
  size_t capacity;
} EdgepuckOptions;

/**
 * The class of a cloud, and how it was found.
 */
typedef struct EdgepuckPrediction {
  /**
   * The class: see edgepuck_class_name. Of equal logits the first wins.
   */
  size_t class_index;
  /**
   * Its probability by the network's softmax, 0 to 1.
   */
  double confidence;
  /**
   * Points of the cloud, without those that were dropped.
   */
  size_t n_points;
  /**
   * Points that were dropped because a coordinate was not finite.
   */
  size_t n_dropped;
  /**
   * Points that the network saw: those that the sampler kept, each once.
   */
  size_t n_used;
  /**
   * Activations that the calibrated ranges of "i8" clipped.
   */
  uint64_t n_clipped;
  /**
   * Whether the precision asked for overflowed on this cloud, so that it was
   * classified in "f32".
   */
  bool fell_back;
  /**
   * Whether the answer is "unknown", because the model is not meant to
   * recognise such an object; class_index then states what it resembles most.
   */
  bool is_unknown;
} EdgepuckPrediction;

/**
 * An object, as edgepuck_live_next tells it.
 */
typedef struct EdgepuckObject {
  /**
   * A number that stays with the object from turn to turn.
   */
  uint64_t track;
  /**
   * The number of the turn, from 0.
   */
  uint64_t turn;
  /**
   * The class by all that was seen of the object, or "unknown"; UTF-8, for as
   * long as the pipeline lives. Null while it has had too few points.
   */
  const char *class_name;
  /**
   * The probability of the class that the object is most like, by all that
   * was seen of it, 0 to 1; NaN while there is none.
   */
  double probability;
  /**
   * The middle of the box around the points, metres, in the sensor's frame.
   */
  double position_m[3];
  /**
   * Length, width and height of that box, metres.
   */
  double size_m[3];
  /**
   * The direction of the length, degrees counterclockwise from x, -90 to 90.
   */
  double yaw_deg;
  /**
   * Metres a second, relative to the sensor; NaN of what was seen once.
   */
  double velocity_m_s[3];
  /**
   * The number of points.
   */
  size_t n_points;
  /**
   * When the first point was measured, seconds of Unix time by the sensor's
   * clock.
   */
  double first_s;
  /**
   * When the last point was.
   */
  double last_s;
} EdgepuckObject;

/**
 * Packets since the start.
 */
typedef struct EdgepuckLiveCounts {
  /**
   * Packets that were decoded.
   */
  uint64_t packets;
  /**
   * Packets that are missing by the time stamps of those that came.
   */
  uint64_t lost;
  /**
   * Packets that came late or twice.
   */
  uint64_t late;
  /**
   * Packets that are not the sensor's data.
   */
  uint64_t foreign;
  /**
   * How often the sensor or its clock began anew.
   */
  uint64_t restarts;
} EdgepuckLiveCounts;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The library's version, such as "0.1.0".
 */
const char *edgepuck_version(void);

/**
 * Loads the model file at path (UTF-8 on Windows) and packs it as options ask;
 * null options are the defaults. Writes the classifier to out, or null when it
 * fails. Pass it to edgepuck_free in the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string, as is every word of options;
 * options is null or valid; out is null or may be written to.
 */
enum EdgepuckStatus edgepuck_load(const char *path,
                                  const struct EdgepuckOptions *options,
                                  struct EdgepuckClassifier **out);

/**
 * Classifies a cloud of n_points points, x y z after x y z, in metres or
 * whatever the unit: only shape counts where clouds are normalised. Writes to
 * out if it succeeds. Allocates nothing for clouds of up to capacity points
 * (see EdgepuckOptions).
 *
 * # Safety
 *
 * classifier is null or comes from edgepuck_load, is not freed, and no other
 * thread uses it now; xyz is null or 3 * n_points floats can be read there;
 * out is null or may be written to.
 */
enum EdgepuckStatus edgepuck_classify(struct EdgepuckClassifier *classifier,
                                      const float *xyz,
                                      size_t n_points,
                                      struct EdgepuckPrediction *out);

/**
 * Copies the logits of the last cloud, one a class, to a buffer of length
 * floats. After votes they are mean log-probabilities.
 *
 * # Safety
 *
 * classifier is null or comes from edgepuck_load, is not freed, and no other
 * thread classifies with it now; out is null or length floats may be written
 * there.
 */
enum EdgepuckStatus edgepuck_logits(const struct EdgepuckClassifier *classifier,
                                    float *out,
                                    size_t length);

/**
 * How many classes the network tells apart; 0 for a null classifier.
 *
 * # Safety
 *
 * classifier is null or comes from edgepuck_load and is not freed.
 */
size_t edgepuck_n_classes(const struct EdgepuckClassifier *classifier);

/**
 * The name of class index, UTF-8, for as long as the classifier lives; null
 * for a null classifier or a class that it does not have.
 *
 * # Safety
 *
 * classifier is null or comes from edgepuck_load and is not freed.
 */
const char *edgepuck_class_name(const struct EdgepuckClassifier *classifier,
                                size_t index);

/**
 * Frees a classifier; null is none.
 *
 * # Safety
 *
 * classifier is null or comes from edgepuck_load; nobody uses it, or a name
 * that it gave, now or later.
 */
void edgepuck_free(struct EdgepuckClassifier *classifier);

/**
 * What went wrong in the last call of this thread that failed; empty if none
 * did. A call that succeeds leaves it as it is.
 *
 * The text is UTF-8 and this thread's: it is gone when another call fails.
 */
const char *edgepuck_last_error(void);

/**
 * Opens a pipeline whose clusters are classified by the model file at path, as
 * options ask (null: the defaults) and by as many threads; those of fewer than
 * min_points points are not classified. The sensor is a Velodyne VLP-16 or
 * VLP-32C, or, if metadata is not null, the Ouster whose metadata file (JSON)
 * that names. Writes the pipeline to out, or null when it fails. Pass it to
 * edgepuck_live_close in the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string, as are metadata and every word of
 * options; options is null or valid; out is null or may be written to.
 */
enum EdgepuckStatus edgepuck_live_open(const char *path,
                                       const struct EdgepuckOptions *options,
                                       const char *metadata,
                                       size_t min_points,
                                       struct EdgepuckLive **out);

/**
 * Takes what one UDP packet of the sensor carries, n_bytes at packet, which
 * came at time_s of Unix time in seconds. Whatever it holds, it is decoded or
 * counted: see edgepuck_live_counts. Then ask edgepuck_live_next.
 *
 * # Safety
 *
 * live is null or comes from edgepuck_live_open, is not closed, and no other
 * thread uses it now; packet is null or n_bytes bytes can be read there.
 */
enum EdgepuckStatus edgepuck_live_take(struct EdgepuckLive *live,
                                       const uint8_t *packet,
                                       size_t n_bytes,
                                       double time_s);

/**
 * Ends what is not complete, as at the end of a recording. Then ask
 * edgepuck_live_next.
 *
 * # Safety
 *
 * live is null or comes from edgepuck_live_open, is not closed, and no other
 * thread uses it now.
 */
enum EdgepuckStatus edgepuck_live_end(struct EdgepuckLive *live);

/**
 * Writes the next object to out and is true; false if there is none until more
 * packets are taken, or if a pointer is null.
 *
 * # Safety
 *
 * live is null or comes from edgepuck_live_open, is not closed, and no other
 * thread uses it now; out is null or may be written to.
 */
bool edgepuck_live_next(struct EdgepuckLive *live, struct EdgepuckObject *out);

/**
 * Writes what came and what did not to out.
 *
 * # Safety
 *
 * live is null or comes from edgepuck_live_open, is not closed, and no other
 * thread takes packets with it now; out is null or may be written to.
 */
enum EdgepuckStatus edgepuck_live_counts(const struct EdgepuckLive *live,
                                         struct EdgepuckLiveCounts *out);

/**
 * Closes a pipeline; null is none.
 *
 * # Safety
 *
 * live is null or comes from edgepuck_live_open; nobody uses it, or a name
 * that it gave, now or later.
 */
void edgepuck_live_close(struct EdgepuckLive *live);

/**
 * The options of a classifier that is loaded without any.
 */
struct EdgepuckOptions edgepuck_options_default(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* EDGEPUCK_H */
