#include "map/mesh.h"

#include <string.h>

static int edge_between(int a, int b) {
    static const uint8_t ends[12][2] = EDGE_ENDS;
    for (int e = 0; e < 12; e++)
        if ((ends[e][0] == a && ends[e][1] == b) || (ends[e][0] == b && ends[e][1] == a)) return e;
    return -1;
}

static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

/* Whether three edges lie on one face. */
static bool on_a_face(int a, int b, int c) {
    for (int f = 0; f < 6; f++) {
        int on = 0;
        for (int k = 0; k < 4; k++) {
            int e = edge_between(faces[f][k], faces[f][(k + 1) % 4]);
            on += (e == a) + (e == b) + (e == c);
        }
        if (on == 3) return true;
    }
    return false;
}

/* A loop's fan from its start-th edge. A triangle within a face would lie back to back with one of the next cube, which
 * may have the same: fans with such a triangle are skipped; each loop has one without. */
static bool fan(const int *loop, int length, int start, uint8_t *out) {
    for (int i = 1; i + 1 < length; i++) {
        int a = loop[start], b = loop[(start + i) % length], c = loop[(start + i + 1) % length];
        if (on_a_face(a, b, c)) return false;
        *out++ = (uint8_t)a;
        *out++ = (uint8_t)b;
        *out++ = (uint8_t)c;
    }
    return true;
}

/* On each face the surface's trace joins the edge where a walk around the face enters the inside with the edge where it
 * leaves again. Two cubes that share a face so agree on it, even where its corners alternate, and the mesh has no
 * holes. Each crossed edge is entered on one of its faces and left on the other, so the joins form loops; each loop is
 * a fan. */
void mesh_cases(uint8_t table[256 * CASE_SIZE]) {
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
        for (int first = 0; first < 12; first++) {
            int loop[12], length = 0;
            for (int e = first; next[e] >= 0; length++) {
                loop[length] = e;
                e = next[e];
                next[loop[length]] = -1;
            }
            if (length == 0) continue;
            int start = 0;
            while (start < length - 1 && !fan(loop, length, start, out)) start++;
            fan(loop, length, start, out);
            out += 3 * (length - 2);
        }
    }
}
