#include <fathom.h>
#include <stdio.h>
#include <stdlib.h>

/* Reads depth frames from stdin, 640x480 16-bit millimetres, 30 per second; prints the camera's position at each. */
int main(void) {
    static uint16_t depth[480][640];
    char why[256] = "out of memory";
    fathom *scan = NULL;
    fathom_config config;
    fathom_config_init(&config); /* a Kinect's intrinsics; a board's own: config.depth_camera */
    int64_t bytes = fathom_memory_required(&config, why, sizeof why);
    void *memory = bytes > 0 ? malloc((size_t)bytes) : NULL;
    if (!memory || fathom_init(&scan, &config, memory, (size_t)bytes, why, sizeof why) != FATHOM_OK)
        return fprintf(stderr, "%s\n", why), 1;

    fathom_depth_frame frame = {.struct_size = sizeof frame, .depth = depth[0], .width = 640, .height = 480};
    fathom_result result = FATHOM_STRUCT(fathom_result);
    for (; fread(depth, sizeof depth, 1, stdin) == 1; frame.timestamp_ns += 33333333) {
        /* with an IMU: fathom_push_imu() for each sample up to here */
        if (fathom_step(scan, &frame, &result) != FATHOM_OK)
            return fprintf(stderr, "%s\n", fathom_last_error(scan)), 1;
        const double *p = result.pose.position;
        printf("%s: x %.4f y %.4f z %.4f m\n", fathom_state_name(result.state), p[0], p[1], p[2]);
    }
    fathom_close(scan);
    free(memory);
    return 0;
}
