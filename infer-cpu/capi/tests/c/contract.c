/*
 * contract MODEL: what edgepuck.h promises, asked in C. MODEL is the tests'
 * model of three classes, "x", "y" and "z".
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "edgepuck.h"

static int n_failed = 0;

#define EXPECT(condition)                                                     \
    do {                                                                      \
        if (!(condition)) {                                                   \
            fprintf(stderr, "line %d: %s (last error: %s)\n", __LINE__,       \
                    #condition, edgepuck_last_error());                       \
            n_failed++;                                                       \
        }                                                                     \
    } while (0)

/* The call has this status, and the message holds these words. */
#define EXPECT_ERROR(call, status, words)                                     \
    do {                                                                      \
        EXPECT((call) == (status));                                           \
        EXPECT(strstr(edgepuck_last_error(), (words)) != NULL);               \
    } while (0)

static const float LONG_IN_Y[] = { 0, 0, 0, 0, 1, 0, 0.1f, 0.5f, 0, 0, 0.5f, 0.1f };

static void loading_fails(const char *model)
{
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckClassifier *classifier = (EdgepuckClassifier *)&options;
    EXPECT_ERROR(edgepuck_load("no/such.safetensors", NULL, &classifier),
                 EDGEPUCK_STATUS_BAD_MODEL, "no/such.safetensors");
    EXPECT(classifier == NULL);
    EXPECT_ERROR(edgepuck_load(NULL, NULL, &classifier),
                 EDGEPUCK_STATUS_BAD_POINTER, "`path`");
    EXPECT_ERROR(edgepuck_load(model, NULL, NULL), EDGEPUCK_STATUS_BAD_POINTER, "`out`");
    options.precision = "f8";
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), EDGEPUCK_STATUS_BAD_OPTION,
                 "option `precision`: unknown precision `f8`, expected one of f32");
    options = edgepuck_options_default();
    options.points = 2;
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), EDGEPUCK_STATUS_BAD_OPTION,
                 "option `sampler`: expected a sampler");
    options.sampler = "voxel";
    options.voxel_size = -1.0;
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), EDGEPUCK_STATUS_BAD_OPTION,
                 "voxel size above 0, found -1");
    options = edgepuck_options_default();
    options.up = 3;
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), EDGEPUCK_STATUS_BAD_OPTION,
                 "option `up`: expected 0, 1 or 2, found 3");
    options = edgepuck_options_default();
    options.votes = 2;
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), EDGEPUCK_STATUS_BAD_OPTION,
                 "votes");
    EXPECT(classifier == NULL);
}

static void null_classifiers_are_refused(void)
{
    EdgepuckPrediction found;
    float logits[3];
    EXPECT_ERROR(edgepuck_classify(NULL, LONG_IN_Y, 4, &found),
                 EDGEPUCK_STATUS_BAD_POINTER, "`classifier`");
    EXPECT_ERROR(edgepuck_logits(NULL, logits, 3), EDGEPUCK_STATUS_BAD_POINTER,
                 "`classifier`");
    EXPECT(edgepuck_class_name(NULL, 0) == NULL);
    EXPECT(edgepuck_n_classes(NULL) == 0);
    edgepuck_free(NULL);
}

static void bad_clouds_are_refused(EdgepuckClassifier *classifier)
{
    float broken[12];
    EdgepuckPrediction found;
    memset(&found, 0xa5, sizeof found);
    EdgepuckPrediction untouched = found;
    memcpy(broken, LONG_IN_Y, sizeof broken);
    broken[7] = NAN;
    EXPECT_ERROR(edgepuck_classify(classifier, broken, 4, &found),
                 EDGEPUCK_STATUS_BAD_CLOUD, "point 2: expected finite coordinates, found (");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, 0, &found),
                 EDGEPUCK_STATUS_BAD_CLOUD, "no points");
    EXPECT_ERROR(edgepuck_classify(classifier, NULL, 0, &found),
                 EDGEPUCK_STATUS_BAD_CLOUD, "no points");
    EXPECT_ERROR(edgepuck_classify(classifier, NULL, 4, &found),
                 EDGEPUCK_STATUS_BAD_POINTER, "`xyz`");
    EXPECT_ERROR(edgepuck_classify(classifier, (const float *)((const char *)broken + 1), 1, &found),
                 EDGEPUCK_STATUS_BAD_POINTER, "`xyz`");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, SIZE_MAX / 2, &found),
                 EDGEPUCK_STATUS_BAD_POINTER, "memory");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, 4, NULL),
                 EDGEPUCK_STATUS_BAD_POINTER, "`out`");
    EXPECT(memcmp(&found, &untouched, sizeof found) == 0);
}

static void logits_are_those_of_the_last_cloud(EdgepuckClassifier *classifier)
{
    EdgepuckPrediction found;
    float logits[4] = { 7, 7, 7, 7 };
    EXPECT_ERROR(edgepuck_logits(classifier, logits, 4), EDGEPUCK_STATUS_NO_PREDICTION,
                 "expected a classified cloud");
    EXPECT(edgepuck_classify(classifier, LONG_IN_Y, 4, &found) == EDGEPUCK_STATUS_OK);
    EXPECT_ERROR(edgepuck_logits(classifier, logits, 2), EDGEPUCK_STATUS_BUFFER_TOO_SMALL,
                 "expected a buffer for 3 logits, found one of 2");
    EXPECT_ERROR(edgepuck_logits(classifier, NULL, 3), EDGEPUCK_STATUS_BAD_POINTER, "`out`");
    EXPECT(logits[0] == 7);
    EXPECT(edgepuck_logits(classifier, logits, 4) == EDGEPUCK_STATUS_OK);
    EXPECT(found.class_index == 1);
    EXPECT(logits[1] > logits[0] && logits[1] > logits[2] && logits[3] == 7);
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        sum += exp((double)logits[i] - (double)logits[1]);
    }
    /* A quotient and a sum of three in double: a few units of 2.2e-16. */
    EXPECT(fabs(found.confidence - 1 / sum) < 1e-14);
    EXPECT(edgepuck_classify(classifier, LONG_IN_Y, 0, &found) == EDGEPUCK_STATUS_BAD_CLOUD);
    EXPECT(edgepuck_logits(classifier, logits, 4) == EDGEPUCK_STATUS_NO_PREDICTION);
}

static void classes_have_names(const EdgepuckClassifier *classifier)
{
    EXPECT(edgepuck_n_classes(classifier) == 3);
    EXPECT(strcmp(edgepuck_class_name(classifier, 0), "x") == 0);
    EXPECT(strcmp(edgepuck_class_name(classifier, 2), "z") == 0);
    EXPECT(edgepuck_class_name(classifier, 3) == NULL);
    EXPECT(strstr(edgepuck_last_error(), "expected a class below 3, found 3") != NULL);
}

static void options_are_followed(const char *model)
{
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckClassifier *classifier = NULL;
    EdgepuckPrediction found;
    float cloud[15];
    memcpy(cloud, LONG_IN_Y, sizeof LONG_IN_Y);
    cloud[12] = cloud[13] = cloud[14] = INFINITY;
    options.threads = 2;
    options.normalization = "unit-sphere";
    options.sampler = "fps";
    options.points = 2;
    options.fps_start = "first";
    options.drop_invalid = true;
    EXPECT(edgepuck_load(model, &options, &classifier) == EDGEPUCK_STATUS_OK);
    EXPECT(edgepuck_classify(classifier, cloud, 5, &found) == EDGEPUCK_STATUS_OK);
    EXPECT(found.n_points == 4 && found.n_dropped == 1 && found.n_used == 2);
    EXPECT(found.n_clipped == 0 && !found.fell_back && !found.is_unknown);
    EXPECT(strcmp(edgepuck_class_name(classifier, found.class_index), "y") == 0);
    edgepuck_free(classifier);
}

int main(int argc, char **argv)
{
    EdgepuckClassifier *classifier = NULL;
    if (argc != 2) {
        return 2;
    }
    EXPECT(strcmp(edgepuck_last_error(), "") == 0);
    printf("%s\n", edgepuck_version());
    loading_fails(argv[1]);
    null_classifiers_are_refused();
    EXPECT(edgepuck_load(argv[1], NULL, &classifier) == EDGEPUCK_STATUS_OK);
    logits_are_those_of_the_last_cloud(classifier);
    bad_clouds_are_refused(classifier);
    classes_have_names(classifier);
    edgepuck_free(classifier);
    options_are_followed(argv[1]);
    return n_failed == 0 ? 0 : 1;
}
