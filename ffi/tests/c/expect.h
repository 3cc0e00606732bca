/* Expectations, which count what fails in n_failed. */
#ifndef EXPECT_H
#define EXPECT_H

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

#define EXPECT_OK(call) EXPECT((call) == EDGEPUCK_STATUS_OK)

/* The call has this status, and the message holds these words. */
#define EXPECT_ERROR(call, status, words)                                     \
    do {                                                                      \
        EXPECT((call) == EDGEPUCK_STATUS_##status);                           \
        EXPECT(strstr(edgepuck_last_error(), (words)) != NULL);               \
    } while (0)

#endif
