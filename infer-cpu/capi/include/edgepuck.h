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
 * A pointer is null, which is an error, or points at what its type says. What was
 * freed or closed is not used any more, nor are texts that are valid as long as it.
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
 * The status of a call. edgepuck_last_error returns a message.
 */
typedef enum EdgepuckStatus {
  /**
   * The call succeeded.
   */
  EDGEPUCK_STATUS_OK = 0,
  /**
   * A pointer is null, or an array is not aligned for its type.
   */
  EDGEPUCK_STATUS_BAD_POINTER = 1,
  /**
   * An option has an invalid value, or one that the model does not support.
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
   * This machine lacks instructions or cannot start threads.
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
   * No cloud has been classified yet, or the last one could not be classified.
   */
  EDGEPUCK_STATUS_NO_PREDICTION = 8,
  /**
   * A defect of this library. The classifier can only be freed.
   */
  EDGEPUCK_STATUS_INTERNAL = 9,
} EdgepuckStatus;

/**
 * A loaded network that classifies clouds. edgepuck_load creates it, and edgepuck_free frees it.
 */
typedef struct EdgepuckClassifier EdgepuckClassifier;

/**
 * A pipeline from the packets of a LiDAR to classified, tracked objects. edgepuck_live_open
 * creates it, and edgepuck_live_close frees it.
 */
typedef struct EdgepuckLive EdgepuckLive;

/**
 * The options of a classifier. Begin with edgepuck_options_default, then change fields. Choices
 * are words, as on infer-cpu's command line; an unknown word gives an error that lists the valid
 * ones.
 */
typedef struct EdgepuckOptions {
  /**
   * The precision: "f32", "f32-fc16" (fp32 arithmetic, with weights of vector layers stored in
   * fp16), "f16" or "i8". Null: "f32".
   */
  const char *precision;
  /**
   * The kernels, such as "scalar" or "neon". Null: the fastest ones of this machine.
   */
  const char *kernel;
  /**
   * The number of threads, including the caller's; 0 counts as 1.
   */
  size_t threads;
  /**
   * The sampler that chooses points for the network: "all", "first", "random", "fps", "voxel" or
   * "cpl". Null: as in training; the next five fields must then have their defaults.
   */
  const char *sampler;
  /**
   * The number of points that the sampler keeps. 0: 1024.
   */
  size_t points;
  /**
   * The seed of random draws.
   */
  uint64_t seed;
  /**
   * The first point of "fps": "farthest" (from the centroid) or "first". Null: "farthest".
   */
  const char *fps_start;
  /**
   * The edge of a voxel for "voxel", in the units of a normalised cloud. 0: as fine as points
   * allows.
   */
  double voxel_size;
  /**
   * The layers whose features "cpl" pools: "auto", "own", "stn" or "trunk". Null: "auto".
   */
  const char *front;
  /**
   * The normalisation of clouds: "unit-sphere", "metric", "metric-sight" or "none". Null: as in
   * training.
   */
  const char *normalization;
  /**
   * Whether points that are not finite are dropped; otherwise they are an error.
   */
  bool drop_invalid;
  /**
   * The number of classifications whose log-probabilities are averaged; more than 1 requires the
   * sampler "random" or vote_rotations.
   */
  uint32_t votes;
  /**
   * Whether the cloud is rotated about its up axis between votes, in equal steps.
   */
  bool vote_rotations;
  /**
   * The axis that points up: 0 for x, 1 for y, 2 for z.
   */
  size_t up;
  /**
   * The number of points for which memory is allocated at loading; larger clouds allocate later.
   */
  size_t capacity;
} EdgepuckOptions;

/**
 * The class of a cloud, and how it was computed.
 */
typedef struct EdgepuckPrediction {
  /**
   * The class: see edgepuck_class_name. If logits are equal, the first wins.
   */
  size_t class_index;
  /**
   * Its probability by the softmax of the network, 0 to 1.
   */
  double confidence;
  /**
   * The number of points of the cloud that are finite.
   */
  size_t n_points;
  /**
   * The number of points that were dropped because a coordinate was not finite.
   */
  size_t n_dropped;
  /**
   * The number of points that the network processed: those that the sampler kept, each once.
   */
  size_t n_used;
  /**
   * The number of activations that were clipped to the calibrated ranges of "i8".
   */
  uint64_t n_clipped;
  /**
   * Whether the requested precision overflowed on this cloud, which was then classified in
   * "f32".
   */
  bool fell_back;
  /**
   * Whether the object belongs to no known class; class_index is then the class that it
   * resembles most.
   */
  bool is_unknown;
} EdgepuckPrediction;

/**
 * An object from edgepuck_live_next.
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
   * The class from all clusters of the object, or "unknown"; UTF-8, valid as long as the
   * pipeline. Null while the object has had too few points.
   */
  const char *class_name;
  /**
   * The probability of the class that the object resembles most, from all of its clusters, 0 to
   * 1; NaN while class_name is null.
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
   * The velocity, metres per second, relative to the sensor; NaN in the first turn of an object.
   */
  double velocity_m_s[3];
  /**
   * The number of points.
   */
  size_t n_points;
  /**
   * When the first point was measured: Unix time in seconds by the sensor's clock.
   */
  double first_s;
  /**
   * When the last point was measured.
   */
  double last_s;
  /**
   * The middle of the box of the whole object, metres, in the sensor's frame: its near side is that
   * of the box around the points, and its size and direction are from all clusters of the object. This
   * and the next two fields are NaN if it is not known: without a class, or for one without a usual size.
   */
  double whole_position_m[3];
  /**
   * Length, width and height of the box of the whole object, metres.
   */
  double whole_size_m[3];
  /**
   * The direction of its length, degrees counterclockwise from x, -180 to 180.
   */
  double whole_yaw_deg;
} EdgepuckObject;

/**
 * The numbers of packets since the start.
 */
typedef struct EdgepuckLiveCounts {
  /**
   * Packets that were decoded.
   */
  uint64_t packets;
  /**
   * Packets that are missing according to the time stamps of the others.
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
   * The number of restarts of the sensor or its clock.
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
 * Loads the model file at path (UTF-8 on Windows) with options; null stands for the defaults.
 * Writes the classifier to out, or null if it fails. Pass it to edgepuck_free in the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string, as is every word of options.
 */
enum EdgepuckStatus edgepuck_load(const char *path,
                                  const struct EdgepuckOptions *options,
                                  struct EdgepuckClassifier **out);

/**
 * Classifies a cloud of n_points points, x y z after x y z, in metres; any unit will do for a
 * model that normalises clouds. Writes to out if it succeeds. Clouds of up to capacity points (see
 * EdgepuckOptions) cause no allocation.
 *
 * # Safety
 *
 * xyz is null or 3 * n_points floats can be read there.
 */
enum EdgepuckStatus edgepuck_classify(struct EdgepuckClassifier *classifier,
                                      const float *xyz,
                                      size_t n_points,
                                      struct EdgepuckPrediction *out);

/**
 * Copies the logits of the last cloud, one per class, to a buffer of length floats. After votes
 * they are mean log-probabilities.
 *
 * # Safety
 *
 * out is null or length floats may be written there.
 */
enum EdgepuckStatus edgepuck_logits(const struct EdgepuckClassifier *classifier,
                                    float *out,
                                    size_t length);

/**
 * The number of classes; 0 for a null classifier.
 */
size_t edgepuck_n_classes(const struct EdgepuckClassifier *classifier);

/**
 * The name of class index, UTF-8, valid as long as the classifier; null for a null classifier or a
 * class that does not exist.
 */
const char *edgepuck_class_name(const struct EdgepuckClassifier *classifier,
                                size_t index);

/**
 * Frees a classifier; null has no effect.
 */
void edgepuck_free(struct EdgepuckClassifier *classifier);

/**
 * Opens a pipeline that classifies clusters with the model file at path and with options (null
 * stands for the defaults), one cluster per thread; clusters of fewer than min_points points are
 * not classified. The sensor is a Velodyne VLP-16 or VLP-32C, or an Ouster if metadata is the path
 * of its metadata file (JSON) instead of null. Writes the pipeline to out, or null if it fails.
 * Objects are reported from the second turn in which they are seen. Pass it to edgepuck_live_close in
 * the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string, as are metadata and every word of options.
 */
enum EdgepuckStatus edgepuck_live_open(const char *path,
                                       const struct EdgepuckOptions *options,
                                       const char *metadata,
                                       size_t min_points,
                                       struct EdgepuckLive **out);

/**
 * Processes the payload of one UDP packet of the sensor, n_bytes at packet, which arrived at the
 * Unix time time_s in seconds. Any content is decoded or counted as foreign: see
 * edgepuck_live_counts. Then call edgepuck_live_next.
 *
 * # Safety
 *
 * packet is null or n_bytes bytes can be read there.
 */
enum EdgepuckStatus edgepuck_live_take(struct EdgepuckLive *live,
                                       const uint8_t *packet,
                                       size_t n_bytes,
                                       double time_s);

/**
 * Completes all clusters, for example at the end of a recording. Then call edgepuck_live_next.
 */
enum EdgepuckStatus edgepuck_live_end(struct EdgepuckLive *live);

/**
 * Writes the next object to out and returns true. Returns false if there is no object until the
 * next packet, or if a pointer is null.
 */
bool edgepuck_live_next(struct EdgepuckLive *live,
                        struct EdgepuckObject *out);

/**
 * Writes the numbers of packets to out.
 */
enum EdgepuckStatus edgepuck_live_counts(const struct EdgepuckLive *live,
                                         struct EdgepuckLiveCounts *out);

/**
 * Closes a pipeline; null has no effect.
 */
void edgepuck_live_close(struct EdgepuckLive *live);

/**
 * The default options.
 */
struct EdgepuckOptions edgepuck_options_default(void);

/**
 * The error message of the last failed call of this thread; empty if no call has failed. A
 * successful call does not change it.
 *
 * The text is UTF-8, and valid until another call of this thread fails.
 */
const char *edgepuck_last_error(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* EDGEPUCK_H */
