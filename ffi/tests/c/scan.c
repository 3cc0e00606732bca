/*
 * scan SENSOR MESH: checks what edgepuck.h promises of scans. SENSOR is the file of a
 * sensor of at most MOST beams; MESH is a file of a square in the plane x = 0, y and z
 * from -1 to 1.
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "expect.h"

enum { MOST = 64, N_THREADS = 4 };

static const double SQUARE[] = { 0, -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1 };
static const uint32_t TRIANGLES[] = { 0, 2, 1, 0, 3, 2 };
static const EdgepuckPose ORIGIN = { { 0, 0, 0 }, { 0, 0, 0, 1 } };
static const EdgepuckPose AHEAD = { { 2, 0, 0 }, { 0, 0, 0, 1 } };

static const EdgepuckPose FAR = { { 3, 0, 0 }, { 0, 0, 0, 1 } };

static void bad_meshes_are_refused(const char *file)
{
    double vertices[12];
    uint32_t triangles[] = { 0, 1, 4 };
    EdgepuckMesh *mesh = (EdgepuckMesh *)vertices;
    EXPECT_ERROR(edgepuck_mesh_read("no/such.obj", &mesh), BAD_MESH, "no/such.obj");
    EXPECT(mesh == NULL);
    EXPECT_ERROR(edgepuck_mesh_read(NULL, &mesh), BAD_POINTER, "`path`");
    EXPECT_ERROR(edgepuck_mesh_read(file, NULL), BAD_POINTER, "`out`");
    memcpy(vertices, SQUARE, sizeof SQUARE);
    EXPECT_ERROR(edgepuck_mesh_new(vertices, 4, triangles, 1, &mesh), BAD_MESH, "4");
    EXPECT_ERROR(edgepuck_mesh_new(vertices, 4, NULL, 0, &mesh), BAD_MESH, "triangle");
    EXPECT_ERROR(edgepuck_mesh_new(NULL, 4, TRIANGLES, 2, &mesh), BAD_POINTER, "`vertices`");
    EXPECT_ERROR(edgepuck_mesh_new(vertices, SIZE_MAX / 8, TRIANGLES, 2, &mesh), BAD_POINTER,
                 "memory");
    vertices[5] = NAN;
    EXPECT_ERROR(edgepuck_mesh_new(vertices, 4, TRIANGLES, 2, &mesh), BAD_MESH, "finite");
    EXPECT(mesh == NULL);
    edgepuck_mesh_free(NULL);
}

static void sensors_have_beams(const EdgepuckSensor *sensor)
{
    EdgepuckSensor *other = NULL;
    EdgepuckBeams beams = edgepuck_sensor_beams(sensor);
    EXPECT_ERROR(edgepuck_sensor_open("vlp33c", &other), BAD_SENSOR, "did you mean \"vlp32c\"?");
    EXPECT_ERROR(edgepuck_sensor_open("no/such.toml", &other), BAD_SENSOR, "no/such.toml");
    EXPECT_ERROR(edgepuck_sensor_open(NULL, &other), BAD_POINTER, "`name_or_file`");
    EXPECT(edgepuck_sensor_beams(NULL).n_beams == 0);
    EXPECT(beams.n_beams > 0);
    for (size_t i = 0; i < beams.n_beams; i++) {
        const double *d = &beams.directions[3 * i];
        /* The sum of three rounded squares: a few units of 2.2e-16. */
        EXPECT(fabs(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1) < 1e-14);
        EXPECT(beams.rings[i] < beams.n_beams && beams.times_s[i] >= 0);
    }
    edgepuck_sensor_free(NULL);
}

static void bad_changes_are_refused(EdgepuckScene *scene, EdgepuckInstance instance)
{
    EdgepuckScene *other = NULL;
    EdgepuckInstance strange = instance;
    EdgepuckPose skew = ORIGIN, lost = ORIGIN;
    skew.quaternion_xyzw[0] = 1;
    lost.position_m[1] = NAN;
    EXPECT_OK(edgepuck_scene_new(&other));
    EXPECT_ERROR(edgepuck_scene_move(other, instance, &ORIGIN), BAD_INSTANCE,
                 "expected one of 0 instances of scene");
    strange.number = 7;
    EXPECT_ERROR(edgepuck_scene_move(scene, strange, &ORIGIN), BAD_INSTANCE, "found number 7");
    EXPECT_ERROR(edgepuck_scene_set(scene, strange, 1, 1, 1, 1, 1), BAD_INSTANCE, "found number 7");
    EXPECT_ERROR(edgepuck_scene_move(scene, instance, &skew), BAD_POSE,
                 "pose.quaternion_xyzw: expected a quaternion of length 1, found "
                 "[1.0, 0.0, 0.0, 1.0] (x, y, z, w) of length 1.4142");
    EXPECT_ERROR(edgepuck_scene_move(scene, instance, &lost), BAD_POSE,
                 "pose.position_m: expected a position of finite metres, found NaN");
    EXPECT_ERROR(edgepuck_scene_move(scene, instance, NULL), BAD_POINTER, "`pose`");
    EXPECT_ERROR(edgepuck_scene_move(NULL, instance, &ORIGIN), BAD_POINTER, "`scene`");
    EXPECT_ERROR(edgepuck_scene_add(scene, NULL, &ORIGIN, &strange), BAD_POINTER, "`mesh`");
    EXPECT_ERROR(edgepuck_scene_set(scene, instance, 1, 0, 1, 1, 1), BAD_VALUE,
                 "scale: expected a number above 0, found 0");
    EXPECT_ERROR(edgepuck_scene_set(scene, instance, 1, 1, 1, 1.5, 1), BAD_VALUE,
                 "reflectivity: expected a number within 0..=1, found 1.5");
    EXPECT_ERROR(edgepuck_scene_set_effects(scene, "nose = 1"), BAD_EFFECTS,
                 "effects: line 1: nose");
    EXPECT_ERROR(edgepuck_scene_set_effects(scene, "noise = { sigma_m = -1 }"), BAD_EFFECTS,
                 "noise.sigma_m: expected");
    EXPECT_ERROR(edgepuck_scene_set_effects(scene, NULL), BAD_POINTER, "`toml`");
    edgepuck_scene_free(other);
    edgepuck_scene_free(NULL);
}

static void bad_scans_are_refused(EdgepuckScene *scene, const EdgepuckSensor *sensor,
                                  EdgepuckInstance plate)
{
    size_t n_beams = edgepuck_sensor_beams(sensor).n_beams;
    EdgepuckPose skew = ORIGIN;
    EdgepuckMoves moves = { &plate, 1, &AHEAD, 1 };
    EdgepuckPose poses[2] = { { { 0, 0, 0 }, { 0, 0, 0, 1 } }, { { 0, 0, 0 }, { 0, 0, 0, 1 } } };
    float range_m[2 * MOST];
    EdgepuckRanges ranges = { 2 * MOST, range_m, NULL };
    EdgepuckPoints points = { 0 };
    range_m[0] = 7;
    skew.quaternion_xyzw[3] = 0.5;
    points.capacity = 1;
    points.range_m = range_m;
    EXPECT_ERROR(edgepuck_scene_scan(scene, sensor, &ORIGIN, 0, &points), BUFFER_TOO_SMALL,
                 "points, found buffers for 1");
    EXPECT(points.n_points > 1 && range_m[0] == 7);
    EXPECT_ERROR(edgepuck_scene_scan(scene, sensor, &skew, 0, &points), BAD_POSE, "length 0.5");
    EXPECT_ERROR(edgepuck_scene_scan(scene, NULL, &ORIGIN, 0, &points), BAD_POINTER, "`sensor`");
    EXPECT_ERROR(edgepuck_scene_scan(scene, sensor, &ORIGIN, 0, NULL), BAD_POINTER, "`points`");
    points.range_m = (float *)((char *)range_m + 1);
    points.capacity = MOST;
    EXPECT_ERROR(edgepuck_scene_scan(scene, sensor, &ORIGIN, 0, &points), BAD_POINTER, "`range`");

    ranges.capacity = 2 * n_beams - 1;
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 2, NULL, 0, &ranges),
                 BUFFER_TOO_SMALL, "ranges, found buffers for");
    ranges.capacity = 2 * MOST;
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 2, &moves, 0, &ranges), BAD_VALUE,
                 "moves.poses: expected 2 times 1 poses, 2, found 1");
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, NULL, 2, NULL, 0, &ranges), BAD_POINTER,
                 "`poses`");
    poses[1].position_m[2] = INFINITY;
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 2, NULL, 0, &ranges), BAD_POSE,
                 "poses[1].position_m: expected");
    moves.poses = &skew;
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 1, &moves, 0, &ranges), BAD_POSE,
                 "moves.poses[0].quaternion_xyzw: expected");
    plate.scene++;
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 1, &moves, 0, &ranges), BAD_INSTANCE,
                 "of scene");
    EXPECT(range_m[0] == 7);
    /* The profile of the test says nothing of its beams' width. */
    EXPECT_OK(edgepuck_scene_set_effects(scene, "footprint = true"));
    EXPECT_ERROR(edgepuck_scene_cast(scene, sensor, poses, 1, NULL, 0, &ranges), BAD_EFFECTS,
                 "effects.footprint");
    EXPECT_OK(edgepuck_scene_set_effects(scene, ""));
}

/* Every column of a plate that faces the sensor 2 m ahead and covers all of its beams. */
static void columns_are_what_they_say(const EdgepuckScene *scene, const EdgepuckSensor *sensor,
                                      EdgepuckInstance plate)
{
    float positions_m[3 * MOST], range_m[MOST], time_s[MOST], intensity[MOST], power[MOST];
    float normal[3 * MOST];
    uint32_t beam[MOST], triangle[MOST], object[MOST], label[MOST];
    uint16_t ring[MOST];
    uint8_t reflectivity[MOST], return_number[MOST], medium[MOST];
    EdgepuckPoints points = {
        MOST, 0, { 1, 1, 1 }, positions_m, range_m, beam, ring, time_s, triangle, object, label,
        intensity, power, reflectivity, return_number, medium, normal
    };
    EdgepuckBeams beams = edgepuck_sensor_beams(sensor);
    EXPECT_OK(edgepuck_scene_scan(scene, sensor, &ORIGIN, 3, &points));
    EXPECT(points.n_points == beams.n_beams && points.origin_m[0] == 0);
    for (size_t i = 0; i < points.n_points; i++) {
        const double *d = &beams.directions[3 * beam[i]];
        /* Ranges and positions are rounded to float once: 2^-24, and 1e-12 for the double. */
        EXPECT(fabs(range_m[i] - 2 / d[0]) < 2 / d[0] * 6e-8);
        EXPECT(fabs(positions_m[3 * i] - 2.0) < 2 * 6e-8);
        EXPECT(fabs(positions_m[3 * i + 1] - 2 * d[1] / d[0]) < 2 * 6e-8);
        /* Reflectivity 0.5, and the cosine of the incidence in float arithmetic. */
        EXPECT(fabs(intensity[i] - 0.5 * d[0]) < 1e-6);
        EXPECT(power[i] > 0 && reflectivity[i] <= 50);
        EXPECT(object[i] == plate.number && label[i] == 42 && triangle[i] < 2);
        EXPECT(return_number[i] == 1 && medium[i] == 0);
        EXPECT(normal[3 * i] == -1);
        EXPECT(ring[i] == beams.rings[beam[i]] && time_s[i] == (float)beams.times_s[beam[i]]);
    }
}

static const EdgepuckScene *shared_scene;
static const EdgepuckSensor *shared_sensor;

/* Scans with a seed of its own, and compares with the ranges of the first thread's scan. */
static void *scan_often(void *ranges_m)
{
    float found[MOST];
    EdgepuckPoints points = { 0 };
    points.capacity = MOST;
    points.range_m = found;
    for (int i = 0; i < 50; i++) {
        if (edgepuck_scene_scan(shared_scene, shared_sensor, &ORIGIN, 3, &points)
                != EDGEPUCK_STATUS_OK
            || memcmp(found, ranges_m, points.n_points * sizeof *found) != 0) {
            return ranges_m;
        }
    }
    return NULL;
}

static void threads_may_share_a_scene(EdgepuckScene *scene, const EdgepuckSensor *sensor)
{
    pthread_t threads[N_THREADS];
    float range_m[MOST], other_m[MOST];
    EdgepuckPoints points = { 0 };
    points.capacity = MOST;
    points.range_m = other_m;
    EXPECT_OK(edgepuck_scene_set_effects(scene, "noise = { sigma_m = 0.1 }"));
    EXPECT_OK(edgepuck_scene_scan(scene, sensor, &ORIGIN, 4, &points));
    points.range_m = range_m;
    EXPECT_OK(edgepuck_scene_scan(scene, sensor, &ORIGIN, 3, &points));
    EXPECT(memcmp(range_m, other_m, points.n_points * sizeof *range_m) != 0);
    shared_scene = scene;
    shared_sensor = sensor;
    for (int i = 0; i < N_THREADS; i++) {
        EXPECT(pthread_create(&threads[i], NULL, scan_often, range_m) == 0);
    }
    for (int i = 0; i < N_THREADS; i++) {
        void *differs = NULL;
        EXPECT(pthread_join(threads[i], &differs) == 0 && differs == NULL);
    }
}

int main(int argc, char **argv)
{
    EdgepuckMesh *read = NULL, *made = NULL;
    EdgepuckSensor *sensor = NULL;
    EdgepuckScene *scene = NULL;
    EdgepuckInstance behind, plate;
    if (argc != 3) {
        return 2;
    }
    EXPECT(strcmp(edgepuck_last_error(), "") == 0);
    printf("%s\n", edgepuck_version());
    bad_meshes_are_refused(argv[2]);
    EXPECT_OK(edgepuck_sensor_open(argv[1], &sensor));
    sensors_have_beams(sensor);
    EXPECT_OK(edgepuck_mesh_read(argv[2], &read));
    EXPECT_OK(edgepuck_mesh_new(SQUARE, 4, TRIANGLES, 2, &made));
    EXPECT_OK(edgepuck_scene_new(&scene));
    EXPECT_OK(edgepuck_scene_add(scene, made, &FAR, &behind));
    EXPECT_OK(edgepuck_scene_add(scene, read, &ORIGIN, &plate));
    EXPECT(behind.number == 0 && plate.number == 1);
    bad_changes_are_refused(scene, plate);
    EXPECT_OK(edgepuck_scene_move(scene, plate, &AHEAD));
    EXPECT_OK(edgepuck_scene_set(scene, plate, 4, 4, 4, 0.5, 42));
    edgepuck_mesh_free(read);
    edgepuck_mesh_free(made);
    bad_scans_are_refused(scene, sensor, plate);
    columns_are_what_they_say(scene, sensor, plate);
    threads_may_share_a_scene(scene, sensor);
    edgepuck_scene_free(scene);
    edgepuck_sensor_free(sensor);
    return n_failed == 0 ? 0 : 1;
}
