/*
 * Edgepuck: the class of a point cloud by PointNet on a CPU, and what a LiDAR or
 * depth camera measures of a scene of meshes. C99, C++.
 *
 * A function returns a status, and edgepuck_last_error the message of the last
 * call that failed. A pointer is null, which is an error unless its function says
 * otherwise, or points at what its type says. What was freed or closed is not
 * used any more, nor are texts and arrays that are valid as long as it. What is
 * passed without const is used by no other thread at the same time. No Rust panic
 * leaves the library; where memory runs out, the process ends.
 *
 * Clouds and packets (the library's feature "classify"):
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
 * Scans (the library's feature "scan"):
 *
 *     EdgepuckMesh *mesh = NULL;
 *     EdgepuckSensor *sensor = NULL;
 *     EdgepuckScene *scene = NULL;
 *     EdgepuckInstance wall;
 *     EdgepuckPose pose = { { 0, 0, 0 }, { 0, 0, 0, 1 } };
 *     EdgepuckStatus status = edgepuck_mesh_read("wall.obj", &mesh);
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         status = edgepuck_sensor_open("vlp32c", &sensor);
 *     }
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         status = edgepuck_scene_new(&scene);
 *     }
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         status = edgepuck_scene_add(scene, mesh, &pose, &wall);
 *     }
 *     if (status == EDGEPUCK_STATUS_OK) {
 *         EdgepuckRanges ranges = { n_beams, range_m, NULL };
 *         status = edgepuck_scene_cast(scene, sensor, &pose, 1, NULL, 0, &ranges);
 *     }
 *     edgepuck_scene_free(scene);
 *     edgepuck_sensor_free(sensor);
 *     edgepuck_mesh_free(mesh);
 *
 * The world is right-handed with z up, in metres. A sensor looks along the x
 * axis of its frame; y is left.
 *
 * Any number of threads may scan and cast one scene at once, and share meshes
 * and sensors, while no thread changes or frees them. The first scan or cast
 * starts a thread for each core (RAYON_NUM_THREADS sets their number); loading
 * the library starts none.
 */

#ifndef EDGEPUCK_H
#define EDGEPUCK_H

/* Written by cbindgen from ffi/src: change that. */

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
   * A pointer is null, or an array is not aligned for its type or is more than the memory can hold.
   */
  EDGEPUCK_STATUS_BAD_POINTER = 1,
  /**
   * A value is out of its bounds, an option is one that the model does not support, or an array has
   * another length than others need.
   */
  EDGEPUCK_STATUS_BAD_VALUE = 2,
  /**
   * The caller's buffers are too short.
   */
  EDGEPUCK_STATUS_BUFFER_TOO_SMALL = 3,
  /**
   * A defect of this library. What was passed to the call can only be freed.
   */
  EDGEPUCK_STATUS_INTERNAL = 4,
  /**
   * The model file cannot be read, or is not a model.
   */
  EDGEPUCK_STATUS_BAD_MODEL = 5,
  /**
   * The cloud has no points, too many, or a coordinate that is not finite.
   */
  EDGEPUCK_STATUS_BAD_CLOUD = 6,
  /**
   * No cloud has been classified yet, or the last one could not be classified.
   */
  EDGEPUCK_STATUS_NO_PREDICTION = 7,
  /**
   * The network's arithmetic leaves the range of float on this cloud.
   */
  EDGEPUCK_STATUS_OVERFLOW = 8,
  /**
   * This machine lacks instructions or cannot start threads.
   */
  EDGEPUCK_STATUS_UNSUPPORTED = 9,
  /**
   * A mesh cannot be read, has no triangle, a coordinate that is not finite, or an index without
   * a vertex.
   */
  EDGEPUCK_STATUS_BAD_MESH = 10,
  /**
   * There is no such sensor, or its file cannot be read.
   */
  EDGEPUCK_STATUS_BAD_SENSOR = 11,
  /**
   * The text of effects is wrong, or the sensor's profile lacks a value that they need.
   */
  EDGEPUCK_STATUS_BAD_EFFECTS = 12,
  /**
   * An instance belongs to another scene.
   */
  EDGEPUCK_STATUS_BAD_INSTANCE = 13,
  /**
   * A pose is not finite, or its quaternion is not a rotation.
   */
  EDGEPUCK_STATUS_BAD_POSE = 14,
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
 * A triangle mesh. Both sides of a triangle are solid.
 */
typedef struct EdgepuckMesh EdgepuckMesh;

/**
 * Instances of meshes in the world. To change an instance rebuilds nothing.
 */
typedef struct EdgepuckScene EdgepuckScene;

/**
 * A LiDAR or depth camera.
 */
typedef struct EdgepuckSensor EdgepuckSensor;

/**
 * The options of a classifier. Begin with edgepuck_options_default, then change fields. Choices
 * are words, as on infer-cpu's command line; an unknown word gives an error that lists the valid
 * ones.
 */
typedef struct EdgepuckOptions {
  /**
   * The precision: "f32" or "i8". Null: "f32".
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
   * The sampler that chooses points for the network: "all", "first", "random", "fps" or
   * "cpl". Null: as in training; the next four fields must then have their defaults.
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

/**
 * A position and an orientation in the world.
 */
typedef struct EdgepuckPose {
  /**
   * The origin of the frame in the world, metres.
   */
  double position_m[3];
  /**
   * The rotation from the frame to the world, a quaternion x, y, z, w. The square of its length
   * is 1 to within 0.001, as of quaternions in float; it is then scaled to length 1.
   */
  double quaternion_xyzw[4];
} EdgepuckPose;

/**
 * The handle of an instance of a scene.
 */
typedef struct EdgepuckInstance {
  /**
   * The scene: each of a process has another number.
   */
  uint32_t scene;
  /**
   * Its number in the scene, from 0, which is the object of its points and ranges.
   */
  uint32_t number;
} EdgepuckInstance;

/**
 * The beams of a sensor, in the order of firing; the arrays are valid as long as the sensor.
 */
typedef struct EdgepuckBeams {
  /**
   * The number of beams.
   */
  size_t n_beams;
  /**
   * Unit vectors in the sensor's frame, x y z after x y z.
   */
  const double *directions;
  /**
   * Rings, counted from below.
   */
  const uint16_t *rings;
  /**
   * Times of firing, seconds since the revolution began.
   */
  const double *times_s;
} EdgepuckBeams;

/**
 * The caller's buffers for the points of a scan. What has a null buffer is not computed: set all to
 * null first, by EdgepuckPoints points = { 0 }.
 */
typedef struct EdgepuckPoints {
  /**
   * The number of points for which each buffer has room.
   */
  size_t capacity;
  /**
   * Written: the number of points, also where they are too many for the buffers.
   */
  size_t n_points;
  /**
   * Written: what to add to each position, metres; 0 near the world's origin.
   */
  double origin_m[3];
  /**
   * Positions in the world less origin_m, metres, x y z after x y z.
   */
  float *positions_m;
  /**
   * Distances from the start of the beam, metres.
   */
  float *range_m;
  /**
   * Numbers of beams, in the order of edgepuck_sensor_beams.
   */
  uint32_t *beam;
  /**
   * Rings, counted from below.
   */
  uint16_t *ring;
  /**
   * Seconds since the revolution began.
   */
  float *time_s;
  /**
   * Numbers of the triangles, in the order of the mesh; UINT32_MAX in the air.
   */
  uint32_t *triangle;
  /**
   * Numbers of the instances; UINT32_MAX in the air.
   */
  uint32_t *object;
  /**
   * Labels of the instances; UINT32_MAX where there is none.
   */
  uint32_t *label;
  /**
   * Intensity, 0 to 1.
   */
  float *intensity;
  /**
   * Received power, relative to that of a white surface that faces the sensor 1 m away.
   */
  float *power;
  /**
   * Calibrated reflectivity: 0 to 100 are percent of a white surface, 101 to 255 retro-reflectors.
   */
  uint8_t *reflectivity;
  /**
   * The number of the return of its beam, from 1, the nearest.
   */
  uint8_t *return_number;
  /**
   * What reflected the beam: 0 a surface, 1 rain, 2 snow, 3 fog, 4 dust or spray.
   */
  uint8_t *medium;
  /**
   * Unit normals of the surfaces, towards the sensor, in the world; 0 in the air.
   */
  float *normal;
} EdgepuckPoints;

/**
 * What moves from pose to pose in edgepuck_scene_cast.
 */
typedef struct EdgepuckMoves {
  /**
   * The instances that move.
   */
  const struct EdgepuckInstance *instances;
  /**
   * The number of instances.
   */
  size_t n_instances;
  /**
   * Their poses: those of all instances for the first pose of the sensor, and so on.
   */
  const struct EdgepuckPose *poses;
  /**
   * The number of poses: the instances times the poses of the sensor.
   */
  size_t n_poses;
} EdgepuckMoves;

/**
 * The caller's buffers for ranges: for each pose a row with a number for each beam, in the order of
 * edgepuck_sensor_beams. A null buffer is left out.
 */
typedef struct EdgepuckRanges {
  /**
   * The number of ranges for which each buffer has room.
   */
  size_t capacity;
  /**
   * Metres; infinite where no return comes back. Of dual returns it is the strongest, or the second
   * strongest if that is the last.
   */
  float *range_m;
  /**
   * The number of the instance; UINT32_MAX where no return comes back, or one from the air.
   */
  uint32_t *object;
} EdgepuckRanges;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

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
 * Copies the logits of the last cloud, one per class, to a buffer of length floats.
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
 * Opens a pipeline that detects objects with the bird's-eye model file at path, beside which is the model
 * that it asks, and with options (null stands for the defaults); clusters of fewer than min_points
 * points have no class. The sensor is a Velodyne VLP-16 or VLP-32C, or an Ouster if metadata is the path
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
 * Reads the OBJ, OFF, PLY, STL or glTF file at path (UTF-8 on Windows), in metres. The y axis of OBJ
 * and glTF points up, and (x, y, z) becomes (x, -z, y); the z axis of all others points up. Writes the
 * mesh to out, or null if it fails. Pass it to edgepuck_mesh_free in the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string.
 */
enum EdgepuckStatus edgepuck_mesh_read(const char *path,
                                       struct EdgepuckMesh **out);

/**
 * Makes a mesh of n_vertices vertices, x y z after x y z, in metres, z up, and n_triangles triangles,
 * three indices of vertices each, which it copies. Writes the mesh to out, or null if it fails. Pass it
 * to edgepuck_mesh_free in the end.
 *
 * # Safety
 *
 * vertices is null or 3 * n_vertices numbers can be read there; triangles is null or 3 * n_triangles
 * numbers can be read there.
 */
enum EdgepuckStatus edgepuck_mesh_new(const double *vertices,
                                      size_t n_vertices,
                                      const uint32_t *triangles,
                                      size_t n_triangles,
                                      struct EdgepuckMesh **out);

/**
 * Frees a mesh, of which instances may still stand in scenes; null has no effect.
 */
void edgepuck_mesh_free(struct EdgepuckMesh *mesh);

/**
 * Makes an empty scene, and writes it to out. Pass it to edgepuck_scene_free in the end.
 */
enum EdgepuckStatus edgepuck_scene_new(struct EdgepuckScene **out);

/**
 * Adds an instance of a mesh at a pose, and writes its handle to out if it succeeds.
 */
enum EdgepuckStatus edgepuck_scene_add(struct EdgepuckScene *scene,
                                       const struct EdgepuckMesh *mesh,
                                       const struct EdgepuckPose *pose,
                                       struct EdgepuckInstance *out);

/**
 * Moves an instance.
 */
enum EdgepuckStatus edgepuck_scene_move(struct EdgepuckScene *scene,
                                        struct EdgepuckInstance instance,
                                        const struct EdgepuckPose *pose);

/**
 * Gives an instance factors along the axes of its mesh, all above 0; the part of the light that comes
 * back at vertical incidence, 0 to 1; and the number of its class, which its points have as label. All
 * are 1 at first, except the label: UINT32_MAX, for none.
 */
enum EdgepuckStatus edgepuck_scene_set(struct EdgepuckScene *scene,
                                       struct EdgepuckInstance instance,
                                       double scale_x,
                                       double scale_y,
                                       double scale_z,
                                       double reflectivity,
                                       uint32_t label);

/**
 * Applies effects to all scans and casts, in place of those before: noise, dropout, wide beams, rain and
 * others. toml has the keys of the table "effects" of a scene's TOML file, such as
 * "noise = { sigma_m = 0.01 }\nreturns = \"dual\""; an empty text has none.
 *
 * # Safety
 *
 * toml is null or a NUL-terminated string.
 */
enum EdgepuckStatus edgepuck_scene_set_effects(struct EdgepuckScene *scene,
                                               const char *toml);

/**
 * Frees a scene; null has no effect.
 */
void edgepuck_scene_free(struct EdgepuckScene *scene);

/**
 * Opens the built-in sensor of this name, such as "vlp32c", or the sensor of this file: a profile
 * (.toml), or the metadata of an Ouster (.json). Writes the sensor to out, or null if it fails. Pass it
 * to edgepuck_sensor_free in the end.
 *
 * # Safety
 *
 * name_or_file is null or a NUL-terminated string.
 */
enum EdgepuckStatus edgepuck_sensor_open(const char *name_or_file,
                                         struct EdgepuckSensor **out);

/**
 * The beams of a sensor; none of a null sensor.
 */
struct EdgepuckBeams edgepuck_sensor_beams(const struct EdgepuckSensor *sensor);

/**
 * Frees a sensor; null has no effect.
 */
void edgepuck_sensor_free(struct EdgepuckSensor *sensor);

/**
 * Scans the scene by a sensor at a pose: one revolution, or one image. Fills the buffers of points. If
 * they are too small, only points->n_points is written: make room, and scan again. A scan has at most
 * one point for each beam, two with the effect returns = "dual", and none for beams without a return.
 *
 * The same scene, pose and seed give the same points. Scans of one seed have the same noise: give each
 * scan of a sequence a seed of its own.
 *
 * # Safety
 *
 * Each buffer of points is null, or has room for as many points as the capacity.
 */
enum EdgepuckStatus edgepuck_scene_scan(const struct EdgepuckScene *scene,
                                        const struct EdgepuckSensor *sensor,
                                        const struct EdgepuckPose *pose,
                                        uint64_t seed,
                                        struct EdgepuckPoints *points);

/**
 * The ranges that a sensor measures at each of n_poses poses, on all cores. Each pose sees a world of
 * its own, in which the instances of moves stand elsewhere; null moves nothing. The scene itself does
 * not change, and nothing is rebuilt. Fills the buffers of ranges if it succeeds.
 *
 * Rows, and casts of other seeds, have other noise. Without noise and other random effects, a row has
 * the ranges of edgepuck_scene_scan at its pose.
 *
 * # Safety
 *
 * poses is null or n_poses poses can be read there; as many instances and poses as moves says can be
 * read at its pointers; each buffer of ranges is null, or has room for as many numbers as the capacity.
 */
enum EdgepuckStatus edgepuck_scene_cast(const struct EdgepuckScene *scene,
                                        const struct EdgepuckSensor *sensor,
                                        const struct EdgepuckPose *poses,
                                        size_t n_poses,
                                        const struct EdgepuckMoves *moves,
                                        uint64_t seed,
                                        const struct EdgepuckRanges *ranges);

/**
 * The library's version, such as "0.1.0".
 */
const char *edgepuck_version(void);

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
