#include <fathom.h>
#include <stdio.h>
#include <stdlib.h>

#define WIDTH 320
#define HEIGHT 240
static uint16_t depth[WIDTH * HEIGHT];

/* Stands in for a depth camera: the corner of a room, millimetres, seen from z metres further in. */
static void take_frame(double z) {
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double u = (x - 159.5) / 262.5, v = (y - 119.5) / 262.5, d = 1.5 - z; /* the wall ahead */
            if (u * d > 0.4) d = 0.4 / u;                                         /* the wall on the right */
            if (v * d > 0.3) d = 0.3 / v;                                         /* the floor */
            depth[WIDTH * y + x] = (uint16_t)(1000 * d + 0.5);
        }
}

static int fail(const char *what, int error) {
    fprintf(stderr, "%s: %s\n", what, fathom_error_name(error));
    return 1;
}

int main(void) {
    fathom_config config = fathom_config_default();
    config.depth_width = WIDTH;
    config.depth_height = HEIGHT;
    config.fx = config.fy = 262.5f;
    config.cx = 159.5f;
    config.cy = 119.5f;

    int64_t bytes = fathom_memory_required(&config);
    if (bytes < 0) return fail("fathom_memory_required", (int)bytes);
    void *memory = malloc((size_t)bytes);
    fathom *scan;
    int error = memory ? fathom_init(&scan, &config, memory, (size_t)bytes) : FATHOM_ERROR_MEMORY;
    if (error < 0) return fail("fathom_init", error);

    for (int i = 0; i < 2; i++) {
        take_frame(0.01 * i);
        /* with an inertial sensor: fathom_push_imu for each sample up to here */
        fathom_depth_frame frame = {i * INT64_C(33333333), depth, WIDTH, HEIGHT};
        fathom_result result;
        error = fathom_step(scan, &frame, &result);
        if (error < 0) return fail("fathom_step", error);
        printf("%s: x %.4f y %.4f z %.4f m\n", fathom_state_name(result.state), result.pose[3], result.pose[7],
               result.pose[11]);
    }
    fathom_close(scan);
    free(memory);
    return 0;
}
