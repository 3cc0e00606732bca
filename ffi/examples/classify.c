/*
 * classify MODEL [CLOUD]: prints the class of a cloud and how sure the network
 * is of it. CLOUD is text, x y z a line; without it, a rod of eight points.
 *
 * Build: see ../README.md.
 */
#include <stdio.h>
#include <stdlib.h>

#include "edgepuck.h"

static const float ROD[] = {
    0.0f, 0.0f, 0.0f, 0.1f, 0.0f, 0.0f, 0.0f, 0.1f, 0.0f, 0.1f, 0.1f, 0.0f,
    0.0f, 0.0f, 1.5f, 0.1f, 0.0f, 1.5f, 0.0f, 0.1f, 1.5f, 0.1f, 0.1f, 1.5f,
};

/* Reads whole points until the file ends; null if it holds something else. */
static float *read_cloud(const char *path, size_t *n_points)
{
    FILE *file = fopen(path, "r");
    float *xyz = NULL;
    size_t n = 0, room = 0;
    int found = 0;
    if (file == NULL) {
        perror(path);
        return NULL;
    }
    for (;;) {
        if (n == room) {
            size_t more = room == 0 ? 1024 : 2 * room;
            float *grown = realloc(xyz, more * 3 * sizeof *xyz);
            if (grown == NULL) {
                perror(path);
                break;
            }
            xyz = grown;
            room = more;
        }
        found = fscanf(file, "%f %f %f", &xyz[3 * n], &xyz[3 * n + 1], &xyz[3 * n + 2]);
        if (found != 3) {
            break;
        }
        n++;
    }
    fclose(file);
    if (found != EOF) {
        fprintf(stderr, "%s: point %zu is not three numbers\n", path, n);
        free(xyz);
        return NULL;
    }
    *n_points = n;
    return xyz;
}

static int fail(void)
{
    fprintf(stderr, "%s\n", edgepuck_last_error());
    return EXIT_FAILURE;
}

static int classify(EdgepuckClassifier *classifier, const float *xyz, size_t n_points)
{
    EdgepuckPrediction found;
    if (edgepuck_classify(classifier, xyz, n_points, &found) != EDGEPUCK_STATUS_OK) {
        return fail();
    }
    printf("%s (%.1f %%), %zu of %zu points used\n",
           edgepuck_class_name(classifier, found.class_index),
           100.0 * found.confidence, found.n_used, found.n_points);
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckClassifier *classifier = NULL;
    int exit_code = EXIT_FAILURE;
    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: %s MODEL [CLOUD]\n", argv[0]);
        return 2;
    }
    options.drop_invalid = true;
    if (edgepuck_load(argv[1], &options, &classifier) != EDGEPUCK_STATUS_OK) {
        return fail();
    }
    if (argc == 2) {
        exit_code = classify(classifier, ROD, sizeof ROD / sizeof ROD[0] / 3);
    } else {
        size_t n_points = 0;
        float *xyz = read_cloud(argv[2], &n_points);
        if (xyz != NULL) {
            exit_code = classify(classifier, xyz, n_points);
        }
        free(xyz);
    }
    edgepuck_free(classifier);
    return exit_code;
}
