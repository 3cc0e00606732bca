/*
 * classify MODEL: checks what edgepuck.h promises of classifiers. MODEL is the tests'
 * model of three classes, "x", "y" and "z".
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "expect.h"

static const float LONG_IN_Y[] = { 0.05f, 0, 0, 0, 1, 0, 0.1f, 0.5f, 0, 0, 0.5f, 0.1f };

static void loading_fails(const char *model)
{
    EdgepuckOptions options = edgepuck_options_default();
    EdgepuckClassifier *classifier = (EdgepuckClassifier *)&options;
    EXPECT_ERROR(edgepuck_load("no/such.safetensors", NULL, &classifier),
                 BAD_MODEL, "no/such.safetensors");
    EXPECT(classifier == NULL);
    EXPECT_ERROR(edgepuck_load(NULL, NULL, &classifier),
                 BAD_POINTER, "`path`");
    EXPECT_ERROR(edgepuck_load(model, NULL, NULL), BAD_POINTER, "`out`");
    options.precision = "f8";
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), BAD_VALUE,
                 "option `precision`: unknown precision `f8`, expected one of f32");
    options = edgepuck_options_default();
    options.points = 2;
    EXPECT_ERROR(edgepuck_load(model, &options, &classifier), BAD_VALUE,
                 "option `sampler`: expected a sampler");
    EXPECT(classifier == NULL);
}

static void null_classifiers_are_refused(void)
{
    EdgepuckPrediction found;
    float logits[3];
    EXPECT_ERROR(edgepuck_classify(NULL, LONG_IN_Y, 4, &found),
                 BAD_POINTER, "`classifier`");
    EXPECT_ERROR(edgepuck_logits(NULL, logits, 3), BAD_POINTER,
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
                 BAD_CLOUD, "point 2: expected finite coordinates, found (");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, 0, &found),
                 BAD_CLOUD, "no points");
    EXPECT_ERROR(edgepuck_classify(classifier, NULL, 0, &found),
                 BAD_CLOUD, "no points");
    EXPECT_ERROR(edgepuck_classify(classifier, NULL, 4, &found),
                 BAD_POINTER, "`xyz`");
    EXPECT_ERROR(edgepuck_classify(classifier, (const float *)((const char *)broken + 1), 1, &found),
                 BAD_POINTER, "`xyz`");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, SIZE_MAX / 2, &found),
                 BAD_POINTER, "memory");
    EXPECT_ERROR(edgepuck_classify(classifier, broken, 4, NULL),
                 BAD_POINTER, "`out`");
    EXPECT(memcmp(&found, &untouched, sizeof found) == 0);
}

static void logits_are_those_of_the_last_cloud(EdgepuckClassifier *classifier)
{
    EdgepuckPrediction found;
    float logits[4] = { 7, 7, 7, 7 };
    EXPECT_ERROR(edgepuck_logits(classifier, logits, 4), NO_PREDICTION,
                 "expected a classified cloud");
    EXPECT_OK(edgepuck_classify(classifier, LONG_IN_Y, 4, &found));
    EXPECT_ERROR(edgepuck_logits(classifier, logits, 2), BUFFER_TOO_SMALL,
                 "expected a buffer for 3 logits, found one of 2");
    EXPECT_ERROR(edgepuck_logits(classifier, NULL, 3), BAD_POINTER, "`out`");
    EXPECT(logits[0] == 7);
    EXPECT_OK(edgepuck_logits(classifier, logits, 4));
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
    EXPECT_OK(edgepuck_load(model, &options, &classifier));
    EXPECT_OK(edgepuck_classify(classifier, cloud, 5, &found));
    EXPECT(found.n_points == 4 && found.n_dropped == 1 && found.n_used == 2);
    EXPECT(found.n_clipped == 0 && !found.is_unknown);
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
    EXPECT_OK(edgepuck_load(argv[1], NULL, &classifier));
    logits_are_those_of_the_last_cloud(classifier);
    bad_clouds_are_refused(classifier);
    classes_have_names(classifier);
    edgepuck_free(classifier);
    options_are_followed(argv[1]);
    return n_failed == 0 ? 0 : 1;
}
