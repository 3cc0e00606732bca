/*
 * Edgepuck: what a LiDAR or depth camera measures of a scene of meshes. C99, C++.
 *
 *     EdgepuckMesh *mesh = NULL;
 *     EdgepuckSensor *sensor = NULL;
 *     EdgepuckScene *scene = NULL;
 *     EdgepuckInstance wall;
 *     EdgepuckPose pose = { { 0, 0, 0 }, { 0, 0, 0, 1 } };
 *     EdgepuckSimStatus status = edgepuck_mesh_read("wall.obj", &mesh);
 *     if (status == EDGEPUCK_SIM_STATUS_OK) {
 *         status = edgepuck_sensor_open("vlp32c", &sensor);
 *     }
 *     if (status == EDGEPUCK_SIM_STATUS_OK) {
 *         status = edgepuck_scene_new(&scene);
 *     }
 *     if (status == EDGEPUCK_SIM_STATUS_OK) {
 *         status = edgepuck_scene_add(scene, mesh, &pose, &wall);
 *     }
 *     if (status == EDGEPUCK_SIM_STATUS_OK) {
 *         EdgepuckRanges ranges = { n_beams, range_m, NULL };
 *         status = edgepuck_scene_cast(scene, sensor, &pose, 1, NULL, 0, &ranges);
 *     }
 *     if (status != EDGEPUCK_SIM_STATUS_OK) {
 *         fprintf(stderr, "%s\n", edgepuck_sim_last_error());
 *     }
 *     edgepuck_scene_free(scene);
 *     edgepuck_sensor_free(sensor);
 *     edgepuck_mesh_free(mesh);
 *
 * The world is right-handed with z up, in metres. A sensor looks along the x
 * axis of its frame; y is left.
 *
 * A pointer is null, which is an error unless its function says otherwise, or
 * points at what its type says. What was freed is not used any more; what is
 * passed without const is used by no other thread at the same time.
 *
 * Any number of threads may scan and cast one scene at once, and share meshes
 * and sensors, while no thread changes or frees them. The first scan or cast
 * starts a thread for each core (RAYON_NUM_THREADS sets their number); loading
 * the library starts none. No Rust panic leaves the library; where memory runs
 * out, the process ends.
 */

#ifndef EDGEPUCK_SIM_H
#define EDGEPUCK_SIM_H

/* Written by cbindgen from sim-gpu/capi/src: change that. */

#include <stddef.h>
#include <stdint.h>

/**
 * The status of a call. edgepuck_sim_last_error returns a message.
 */
typedef enum EdgepuckSimStatus {
  /**
   * The call succeeded.
   */
  EDGEPUCK_SIM_STATUS_OK = 0,
  /**
   * A pointer is null, or an array is not aligned for its type or is more than the memory can hold.
   */
  EDGEPUCK_SIM_STATUS_BAD_POINTER = 1,
  /**
   * A mesh cannot be read, has no triangle, a coordinate that is not finite, or an index without
   * a vertex.
   */
  EDGEPUCK_SIM_STATUS_BAD_MESH = 2,
  /**
   * There is no such sensor, or its file cannot be read.
   */
  EDGEPUCK_SIM_STATUS_BAD_SENSOR = 3,
  /**
   * The text of effects is wrong, or the sensor's profile lacks a value that they need.
   */
  EDGEPUCK_SIM_STATUS_BAD_EFFECTS = 4,
  /**
   * An instance belongs to another scene.
   */
  EDGEPUCK_SIM_STATUS_BAD_INSTANCE = 5,
  /**
   * A pose is not finite, or its quaternion is not a rotation.
   */
  EDGEPUCK_SIM_STATUS_BAD_POSE = 6,
  /**
   * Another value is out of its bounds, or an array has another length than others need.
   */
  EDGEPUCK_SIM_STATUS_BAD_VALUE = 7,
  /**
   * The caller's buffers are too short.
   */
  EDGEPUCK_SIM_STATUS_BUFFER_TOO_SMALL = 8,
  /**
   * A defect of this library. What was passed to the call can only be freed.
   */
  EDGEPUCK_SIM_STATUS_INTERNAL = 9,
} EdgepuckSimStatus;

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

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Reads the OBJ, OFF, PLY, STL or glTF file at path (UTF-8 on Windows), in metres. The y axis of OBJ
 * and glTF points up, and (x, y, z) becomes (x, -z, y); the z axis of all others points up. Writes the
 * mesh to out, or null if it fails. Pass it to edgepuck_mesh_free in the end.
 *
 * # Safety
 *
 * path is null or a NUL-terminated string.
 */
enum EdgepuckSimStatus edgepuck_mesh_read(const char *path,
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
enum EdgepuckSimStatus edgepuck_mesh_new(const double *vertices,
                                         size_t n_vertices,
                                         const uint32_t *triangles,
                                         size_t n_triangles,
                                         struct EdgepuckMesh **out);

/**
 * Frees a mesh, of which instances may still stand in scenes; null has no effect.
 */
void edgepuck_mesh_free(struct EdgepuckMesh *mesh);

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
enum EdgepuckSimStatus edgepuck_scene_scan(const struct EdgepuckScene *scene,
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
enum EdgepuckSimStatus edgepuck_scene_cast(const struct EdgepuckScene *scene,
                                           const struct EdgepuckSensor *sensor,
                                           const struct EdgepuckPose *poses,
                                           size_t n_poses,
                                           const struct EdgepuckMoves *moves,
                                           uint64_t seed,
                                           const struct EdgepuckRanges *ranges);

/**
 * Makes an empty scene, and writes it to out. Pass it to edgepuck_scene_free in the end.
 */
enum EdgepuckSimStatus edgepuck_scene_new(struct EdgepuckScene **out);

/**
 * Adds an instance of a mesh at a pose, and writes its handle to out if it succeeds.
 */
enum EdgepuckSimStatus edgepuck_scene_add(struct EdgepuckScene *scene,
                                          const struct EdgepuckMesh *mesh,
                                          const struct EdgepuckPose *pose,
                                          struct EdgepuckInstance *out);

/**
 * Moves an instance.
 */
enum EdgepuckSimStatus edgepuck_scene_move(struct EdgepuckScene *scene,
                                           struct EdgepuckInstance instance,
                                           const struct EdgepuckPose *pose);

/**
 * Gives an instance factors along the axes of its mesh, all above 0; the part of the light that comes
 * back at vertical incidence, 0 to 1; and the number of its class, which its points have as label. All
 * are 1 at first, except the label: UINT32_MAX, for none.
 */
enum EdgepuckSimStatus edgepuck_scene_set(struct EdgepuckScene *scene,
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
enum EdgepuckSimStatus edgepuck_scene_set_effects(struct EdgepuckScene *scene,
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
enum EdgepuckSimStatus edgepuck_sensor_open(const char *name_or_file,
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
 * The error message of the last failed call of this thread; empty if no call has failed. A
 * successful call does not change it.
 *
 * The text is UTF-8, and valid until another call of this thread fails.
 */
const char *edgepuck_sim_last_error(void);

/**
 * The library's version, such as "0.1.0".
 */
const char *edgepuck_sim_version(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* EDGEPUCK_SIM_H */
