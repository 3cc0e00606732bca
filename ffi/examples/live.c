/*
 * live MODEL CAPTURE: prints the objects that a Velodyne saw, one a line: track,
 * class, x y z in metres, number of points, and the length of the whole object in
 * metres where its class has a usual size. CAPTURE is a file in libpcap's classic
 * format, of Ethernet frames with IPv4.
 *
 * Build: see ../README.md.
 */
#include <stdio.h>
#include <stdlib.h>

#include "edgepuck.h"

/* Bytes of the file's header, of a frame's, of Ethernet's and of UDP's. */
enum { FILE_HEADER = 24, FRAME_HEADER = 16, ETHERNET = 14, UDP = 8 };

static unsigned char frame[65536];

static unsigned long word(const unsigned char *at)
{
    return at[0] | (unsigned long)at[1] << 8 | (unsigned long)at[2] << 16 |
           (unsigned long)at[3] << 24;
}

static void print_objects(EdgepuckLive *live)
{
    EdgepuckObject object;
    while (edgepuck_live_next(live, &object)) {
        printf("%llu %s %.3f %.3f %.3f %zu ", (unsigned long long)object.track,
               object.class_name != NULL ? object.class_name : "-", object.position_m[0],
               object.position_m[1], object.position_m[2], object.n_points);
        if (object.whole_size_m[0] > 0) {
            printf("%.3f\n", object.whole_size_m[0]);
        } else {
            puts("-");
        }
    }
}

/* Takes the packets of a capture; 0 if it is one. */
static int replay(EdgepuckLive *live, FILE *file, const char *path)
{
    unsigned char header[FILE_HEADER];
    if (fread(header, 1, FILE_HEADER, file) != FILE_HEADER || word(header) != 0xa1b2c3d4ul) {
        fprintf(stderr, "%s: expected a capture with times in microseconds\n", path);
        return 1;
    }
    while (fread(header, 1, FRAME_HEADER, file) == FRAME_HEADER) {
        size_t n_bytes = word(header + 8);
        size_t start;
        if (n_bytes > sizeof frame || fread(frame, 1, n_bytes, file) != n_bytes) {
            fprintf(stderr, "%s: the file ends within a frame\n", path);
            return 1;
        }
        start = ETHERNET + 4 * (size_t)(frame[ETHERNET] & 15) + UDP;
        if (n_bytes <= start) {
            continue;
        }
        if (edgepuck_live_take(live, frame + start, n_bytes - start,
                               (double)word(header) + 1e-6 * (double)word(header + 4)) !=
            EDGEPUCK_STATUS_OK) {
            fprintf(stderr, "%s\n", edgepuck_last_error());
            return 1;
        }
        print_objects(live);
    }
    edgepuck_live_end(live);
    print_objects(live);
    return 0;
}

int main(int argc, char **argv)
{
    EdgepuckLive *live = NULL;
    EdgepuckLiveCounts counts;
    FILE *file;
    int failed;
    if (argc != 3) {
        fprintf(stderr, "usage: %s MODEL CAPTURE\n", argv[0]);
        return 2;
    }
    file = fopen(argv[2], "rb");
    if (file == NULL) {
        perror(argv[2]);
        return EXIT_FAILURE;
    }
    if (edgepuck_live_open(argv[1], NULL, NULL, 20, &live) != EDGEPUCK_STATUS_OK) {
        fprintf(stderr, "%s\n", edgepuck_last_error());
        fclose(file);
        return EXIT_FAILURE;
    }
    failed = replay(live, file, argv[2]);
    if (edgepuck_live_counts(live, &counts) == EDGEPUCK_STATUS_OK) {
        fprintf(stderr, "%llu packets, %llu lost, %llu foreign\n",
                (unsigned long long)counts.packets, (unsigned long long)counts.lost,
                (unsigned long long)counts.foreign);
    }
    edgepuck_live_close(live);
    fclose(file);
    return failed ? EXIT_FAILURE : EXIT_SUCCESS;
}
