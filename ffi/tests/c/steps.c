/*
 * steps SENSOR: moves an instance and casts, 100,000 times. The memory of the process
 * stays flat: a leak of the smallest block of malloc, 32 bytes in glibc, in each step would
 * take 3.2 MB; half of that is allowed, for allocators that keep what was freed.
 *
 * Linux tells both the resident set and the number of threads.
 */
#include <stdio.h>
#include <string.h>

#include "edgepuck.h"

enum { N_STEPS = 100000, N_WARM = 1000, BLOCK_BYTES = 32, MOST_BEAMS = 16 };

static const double VERTICES[] = { 0, -1, -1, 0, 1, -1, 0, 0, 1 };
static const uint32_t TRIANGLES[] = { 0, 1, 2 };

/* A number of /proc/self/status: kilobytes or threads; -1 if it is not there. */
static long status_of(const char *key)
{
    char line[256];
    long found = -1;
    FILE *file = fopen("/proc/self/status", "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        if (strncmp(line, key, strlen(key)) == 0) {
            sscanf(line + strlen(key), ":%ld", &found);
        }
    }
    if (file != NULL) {
        fclose(file);
    }
    return found;
}

int main(int argc, char **argv)
{
    EdgepuckMesh *mesh = NULL;
    EdgepuckSensor *sensor = NULL;
    EdgepuckScene *scene = NULL;
    EdgepuckInstance instance;
    EdgepuckPose pose = { { 5, 0, 0 }, { 0, 0, 0, 1 } }, origin = { { 0, 0, 0 }, { 0, 0, 0, 1 } };
    EdgepuckMoves moves = { &instance, 1, &pose, 1 };
    float range_m[MOST_BEAMS];
    EdgepuckRanges ranges = { MOST_BEAMS, range_m, NULL };
    long before_kb = 0, grown_kb;
    int n_failed = 0;
    if (argc != 2) {
        return 2;
    }
    n_failed += edgepuck_mesh_new(VERTICES, 3, TRIANGLES, 1, &mesh) != EDGEPUCK_STATUS_OK;
    n_failed += edgepuck_sensor_open(argv[1], &sensor) != EDGEPUCK_STATUS_OK;
    n_failed += edgepuck_scene_new(&scene) != EDGEPUCK_STATUS_OK;
    n_failed += edgepuck_scene_add(scene, mesh, &origin, &instance) != EDGEPUCK_STATUS_OK;
    printf("%ld thread before the first cast\n", status_of("Threads"));
    for (int i = 0; i < N_STEPS && n_failed == 0; i++) {
        if (i == N_WARM) {
            before_kb = status_of("VmRSS");
        }
        pose.position_m[0] = 5 + 1e-5 * i;
        n_failed += edgepuck_scene_move(scene, instance, &pose) != EDGEPUCK_STATUS_OK;
        n_failed += edgepuck_scene_cast(scene, sensor, &origin, 1, i % 2 ? &moves : NULL, i, &ranges)
                    != EDGEPUCK_STATUS_OK;
    }
    grown_kb = status_of("VmRSS") - before_kb;
    if (n_failed != 0) {
        fprintf(stderr, "%s\n", edgepuck_last_error());
    } else if (grown_kb * 1000 > (long)N_STEPS * BLOCK_BYTES / 2) {
        fprintf(stderr, "the resident set grew by %ld kB\n", grown_kb);
        n_failed++;
    }
    edgepuck_scene_free(scene);
    edgepuck_sensor_free(sensor);
    edgepuck_mesh_free(mesh);
    return n_failed == 0 ? 0 : 1;
}
