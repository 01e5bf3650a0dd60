#include <string.h>

#include "map/mesh.h"

static int edge_between(int a, int b) {
    static const uint8_t ends[12][2] = EDGE_ENDS;
    for (int e = 0; e < 12; e++)
        if ((ends[e][0] == a && ends[e][1] == b) || (ends[e][0] == b && ends[e][1] == a)) return e;
    return -1;
}

/* On each face the surface's trace joins the edge where a walk around the face enters the inside with the edge where it
 * leaves again. Two cubes that share a face so agree on it, even where its corners alternate, and the mesh has no holes.
 * Each crossed edge is entered on one of its faces and left on the other, so the joins form loops; each loop is a fan. */
void mesh_cases(uint8_t table[256 * CASE_SIZE]) {
    static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    memset(table, CASE_END, 256 * CASE_SIZE);
    for (int kind = 0; kind < 256; kind++) {
        int next[12];
        for (int e = 0; e < 12; e++) next[e] = -1;
        for (int f = 0; f < 6; f++)
            for (int k = 0; k < 4; k++) {
                int outside = faces[f][k], inside = faces[f][(k + 1) % 4];
                if (kind >> outside & 1 || !(kind >> inside & 1)) continue;
                int m = k + 1;
                while (kind >> faces[f][(m + 1) % 4] & 1) m++;
                next[edge_between(outside, inside)] = edge_between(faces[f][m % 4], faces[f][(m + 1) % 4]);
            }
        uint8_t *out = table + CASE_SIZE * kind;
        for (int start = 0; start < 12; start++) {
            if (next[start] < 0) continue;
            int a = next[start], b = next[a];
            while (b != start) {
                *out++ = (uint8_t)start;
                *out++ = (uint8_t)a;
                *out++ = (uint8_t)b;
                next[a] = -1;
                a = b;
                b = next[b];
            }
            next[a] = next[start] = -1;
        }
    }
}
