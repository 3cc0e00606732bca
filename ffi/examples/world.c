/*
 * world [SENSOR [EFFECTS]]: scans a wall 10 m ahead of the sensor and a plate
 * before it, moves the plate, and casts from three poses at once. SENSOR is a name,
 * such as vlp16, or a TOML file; EFFECTS are TOML, such as
 * "noise = { sigma_m = 0.01 }".
 *
 * It prints a line for each point (beam, range, object and label) and for each
 * range of the cast (pose, beam, range and object).
 *
 * Build: see ../README.md.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "edgepuck.h"

enum { N_POSES = 3, CLASS_WALL = 1, CLASS_PLATE = 7 };

/* A square in the plane x = 0 with corners at y = +-1, z = +-1, metres. */
static const double VERTICES[] = { 0, -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1 };
static const uint32_t TRIANGLES[] = { 0, 2, 1, 0, 3, 2 };

static const EdgepuckPose SENSOR_POSE = { { 0, 0, 0 }, { 0, 0, 0, 1 } };

/* Ends the program if a call failed. */
static void check(EdgepuckStatus status)
{
    if (status != EDGEPUCK_STATUS_OK) {
        fprintf(stderr, "%s\n", edgepuck_last_error());
        exit(EXIT_FAILURE);
    }
}

static void *allocate(size_t n, size_t size)
{
    void *memory = calloc(n, size);
    if (memory == NULL) {
        perror("calloc");
        exit(EXIT_FAILURE);
    }
    return memory;
}

static EdgepuckPose at_x(double x)
{
    EdgepuckPose pose = { { 0, 0, 0 }, { 0, 0, 0, 1 } };
    pose.position_m[0] = x;
    return pose;
}

/* Adds the square, `half` metres from its middle to its sides, `x` metres ahead. */
static EdgepuckInstance add(EdgepuckScene *scene, const EdgepuckMesh *square, double x,
                            double half, double reflectivity, uint32_t label)
{
    EdgepuckPose pose = at_x(x);
    EdgepuckInstance instance;
    check(edgepuck_scene_add(scene, square, &pose, &instance));
    check(edgepuck_scene_set(scene, instance, 1, half, half, reflectivity, label));
    return instance;
}

static void scan(const EdgepuckScene *scene, const EdgepuckSensor *sensor)
{
    /* Two points a beam, for returns = "dual". */
    EdgepuckPoints points = { 0 };
    points.capacity = 2 * edgepuck_sensor_beams(sensor).n_beams;
    points.beam = allocate(points.capacity, sizeof *points.beam);
    points.range_m = allocate(points.capacity, sizeof *points.range_m);
    points.object = allocate(points.capacity, sizeof *points.object);
    points.label = allocate(points.capacity, sizeof *points.label);
    check(edgepuck_scene_scan(scene, sensor, &SENSOR_POSE, 7, &points));
    for (size_t i = 0; i < points.n_points; i++) {
        printf("%u %.9g %u %u\n", (unsigned)points.beam[i], points.range_m[i],
               (unsigned)points.object[i], (unsigned)points.label[i]);
    }
    free(points.beam);
    free(points.range_m);
    free(points.object);
    free(points.label);
}

/* Casts from three poses; the plate is 2 m, 3 m and 4 m ahead of the origin. */
static void cast(const EdgepuckScene *scene, const EdgepuckSensor *sensor,
                 EdgepuckInstance plate)
{
    const size_t n_beams = edgepuck_sensor_beams(sensor).n_beams;
    EdgepuckPose poses[N_POSES], of_plate[N_POSES];
    EdgepuckMoves moves = { &plate, 1, of_plate, N_POSES };
    EdgepuckRanges ranges = { 0, NULL, NULL };
    for (size_t i = 0; i < N_POSES; i++) {
        poses[i] = at_x(0.25 * (double)i);
        of_plate[i] = at_x(2 + (double)i);
    }
    ranges.capacity = N_POSES * n_beams;
    ranges.range_m = allocate(ranges.capacity, sizeof *ranges.range_m);
    ranges.object = allocate(ranges.capacity, sizeof *ranges.object);
    check(edgepuck_scene_cast(scene, sensor, poses, N_POSES, &moves, 7, &ranges));
    for (size_t i = 0; i < ranges.capacity; i++) {
        if (isfinite(ranges.range_m[i])) {
            printf("%zu %zu %.9g %u\n", i / n_beams, i % n_beams, ranges.range_m[i],
                   (unsigned)ranges.object[i]);
        }
    }
    free(ranges.range_m);
    free(ranges.object);
}

int main(int argc, char **argv)
{
    EdgepuckMesh *square = NULL;
    EdgepuckSensor *sensor = NULL;
    EdgepuckScene *scene = NULL;
    EdgepuckInstance plate;
    EdgepuckPose aside = { { 5, 1, 0 }, { 0, 0, 0, 1 } };

    check(edgepuck_mesh_new(VERTICES, 4, TRIANGLES, 2, &square));
    check(edgepuck_sensor_open(argc > 1 ? argv[1] : "rplidar-a1", &sensor));
    check(edgepuck_scene_new(&scene));
    add(scene, square, 10, 9, 1, CLASS_WALL);
    plate = add(scene, square, 5, 0.5, 0.3, CLASS_PLATE);
    edgepuck_mesh_free(square); /* The instances keep what they need. */
    check(edgepuck_scene_set_effects(scene, argc > 2 ? argv[2] : ""));

    check(edgepuck_scene_move(scene, plate, &aside));
    scan(scene, sensor);
    cast(scene, sensor, plate);

    edgepuck_scene_free(scene);
    edgepuck_sensor_free(sensor);
    return EXIT_SUCCESS;
}
