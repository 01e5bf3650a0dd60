/* Two frames of a bent surface through the library's public interface: exits 0 when the second is tracked and fused. Linked
 * by tests/e2e/symbols.sh with functions of the library's inner names. */
#include <stdio.h>
#include <stdlib.h>

#include "fathom.h"

#define WIDTH 64
#define HEIGHT 48

static uint16_t frame[WIDTH * HEIGHT];

int main(void) {
    fathom_config c;
    fathom_config_init(&c);
    c.depth_camera.width = WIDTH;
    c.depth_camera.height = HEIGHT;
    c.depth_camera.fx = c.depth_camera.fy = 55;
    c.depth_camera.cx = 31.5f;
    c.depth_camera.cy = 23.5f;
    c.voxel_m = 0.04f;
    c.max_memory_bytes = 32 << 20;
    c.imu = false;
    char why[256];
    fathom *scan = NULL;
    int64_t bytes = fathom_memory_required(&c, why, sizeof why);
    void *block = bytes > 0 ? malloc((size_t)bytes) : NULL;
    if (!block || fathom_init(&scan, &c, block, (size_t)bytes, why, sizeof why) != FATHOM_OK) {
        fprintf(stderr, "%s\n", why);
        return 1;
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double u = (i % WIDTH - 31.5) / 55, v = (i / WIDTH - 23.5) / 55;
        double bump = u * u + v * v < 0.04 ? 0.3 - 6 * (u * u + v * v) : 0;
        frame[i] = (uint16_t)(1000 * (1.4 + 0.2 * u - 0.3 * v + (u > 0.35 ? -0.3 : 0) - bump));
    }
    fathom_result r = FATHOM_STRUCT(fathom_result);
    for (int i = 1; i <= 2; i++) {
        fathom_depth_frame f = FATHOM_STRUCT(fathom_depth_frame);
        f.width = WIDTH;
        f.height = HEIGHT;
        f.timestamp_ns = i * 33333333;
        f.depth = frame;
        int e = fathom_step(scan, &f, &r);
        printf("frame %d: %s, %s, %d pairs, %d blocks\n", i, fathom_error_name(e), fathom_state_name(r.state), (int)r.pairs,
               (int)r.blocks);
        if (e != FATHOM_OK) return 1;
    }
    fathom_close(scan);
    free(block);
    return !(r.state == FATHOM_TRACKED && r.fused && r.pairs > 1000 && r.blocks > 0);
}
