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

int main(void) {
    fathom_config config;
    fathom_config_init(&config);
    config.depth_camera =
        (fathom_pinhole){.width = WIDTH, .height = HEIGHT, .fx = 262.5, .fy = 262.5, .cx = 159.5, .cy = 119.5};

    char why[256] = "out of memory";
    fathom *scan = NULL;
    int64_t bytes = fathom_memory_required(&config, why, sizeof why);
    void *memory = bytes > 0 ? malloc((size_t)bytes) : NULL;
    if (!memory || fathom_init(&scan, &config, memory, (size_t)bytes, why, sizeof why) != FATHOM_OK) {
        fprintf(stderr, "%s\n", why);
        return 1;
    }
    for (int i = 0; i < 2; i++) {
        take_frame(0.01 * i);
        /* with an inertial sensor: fathom_push_imu for each sample up to here */
        fathom_depth_frame frame = {.struct_size = sizeof frame,
                                    .timestamp_ns = i * INT64_C(33333333),
                                    .depth = depth,
                                    .width = WIDTH,
                                    .height = HEIGHT};
        fathom_result result = FATHOM_STRUCT(fathom_result);
        if (fathom_step(scan, &frame, &result) != FATHOM_OK) {
            fprintf(stderr, "%s\n", fathom_last_error(scan));
            return 1;
        }
        const double *p = result.pose.position;
        printf("%s: x %.4f y %.4f z %.4f m\n", fathom_state_name(result.state), p[0], p[1], p[2]);
    }
    fathom_close(scan);
    free(memory);
    return 0;
}
