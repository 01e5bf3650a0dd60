/* Value noise: normal numbers on a lattice, between which weights lead smoothly from one to the next (Perlin 2002,
 * "Improving noise", SIGGRAPH: 6 s^5 - 15 s^4 + 10 s^3). The weights are scaled so that their squares' sum is 1, and so
 * the variance is the same everywhere. */
#include "simulate/smooth_noise.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "simulate/counter_random.h"

struct step {
    int from;          /* the lattice's node before */
    float here, after; /* weights of that node and of the next */
};

static struct step step_at(double at) {
    const double from = floor(at), s = at - from;
    const double after = s * s * s * (s * (6.0 * s - 15.0) + 10.0), here = 1.0 - after;
    const double scale = 1.0 / sqrt(here * here + after * after);
    return (struct step){(int)from, (float)(here * scale), (float)(after * scale)};
}

double smooth_noise_at(double age, uint64_t key) {
    const struct step t = step_at(age);
    return t.here * random_normal(key, (uint64_t)t.from) + t.after * random_normal(key, (uint64_t)t.from + 1);
}

/* The lattice at its time. A node's number depends on its own place only, not on the picture's size. */
static void make_nodes(float *nodes, int columns, int rows, double age, uint64_t key) {
    const struct step t = step_at(age);
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) {
            const uint64_t node = ((uint64_t)y << 16 | (uint64_t)x) << 32;
            float value = t.here * (float)random_normal(key, node + (uint64_t)t.from);
            if (t.after > 0.0f) value += t.after * (float)random_normal(key, node + (uint64_t)t.from + 1);
            nodes[y * columns + x] = value;
        }
}

bool smooth_noise_add(float *values, int width, int height, double pitch, double age, double scale,
                      uint64_t key) {
    const int columns = (int)((width - 1) / pitch) + 2, rows = (int)((height - 1) / pitch) + 2;
    float *nodes = malloc((size_t)columns * (size_t)rows * sizeof *nodes);
    struct step *across = malloc((size_t)width * sizeof *across);
    if (nodes && across) {
        make_nodes(nodes, columns, rows, age, key);
        for (int x = 0; x < width; x++) across[x] = step_at(x / pitch);
        for (int y = 0; y < height; y++) {
            const struct step v = step_at(y / pitch);
            const float *up = nodes + (size_t)v.from * (size_t)columns, *down = up + columns;
            float *row = values + (size_t)y * (size_t)width;
            for (int x = 0; x < width; x++) {
                const struct step *u = &across[x];
                row[x] += (float)scale * (v.here * (u->here * up[u->from] + u->after * up[u->from + 1]) +
                                          v.after * (u->here * down[u->from] + u->after * down[u->from + 1]));
            }
        }
    }
    const bool done = nodes && across;
    free(nodes);
    free(across);
    return done;
}
