/* Finds the vertices of a PLY file by exact position, in 7 to 10 bytes of memory per vertex and a window of 1 MB.
 *
 * Triangles that share a corner mostly come soon after each other, so that a window of recent corners finds it. A hash
 * table of vertex numbers finds the others; it holds no positions but reads them back from the file. */
#ifndef FATHOM_CLI_CORNERS_H
#define FATHOM_CLI_CORNERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct corner_slot;

struct corners {
    FILE *file;        /* of vertices, in the order of their numbers; open for writing and reading */
    long first;        /* position of vertex 0 */
    uint32_t readable; /* vertices below this number have been flushed */

    struct corner_slot *window;
    uint32_t clock; /* picks the slot of a full set that is overwritten */

    uint32_t *numbers; /* open addressing */
    uint8_t *tags;     /* 0: free; else bits of the hash, which avoid most reads */
    uint64_t size, count;

    /* of the last position that wasn't found */
    uint64_t place;
    uint8_t tag;
};

#define CORNER_BYTES 24 /* of a vertex in the file; its position comes first, as little-endian floats */

/* False: no memory (errno). corners_close must follow either way. */
bool corners_open(struct corners *corners, FILE *file, long first);
void corners_close(struct corners *corners);

/* Looks for a position. 1: found, *number is set; 0: not found; -1: the file can't be read, or no memory (errno). */
int corners_find(struct corners *corners, const float position[3], uint32_t *number);

/* Adds the position that the last corners_find didn't find. Its vertex must be written to the file before the next
 * call. */
void corners_add(struct corners *corners, const float position[3], uint32_t number);

#endif
