/* The stack that a context's calls take, OpenCL runtime included: they run on a thread whose stack was painted before.
 * Prints a line a call; docs/PORTING.md has the figures. tests/e2e/stack.sh holds the library's own part. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fathom.h"

#define WIDTH 320
#define HEIGHT 240
#define STACK (8 << 20)
#define PAINT 0xa5

static uint16_t frame[WIDTH * HEIGHT];
static fathom *scan;
static void *block;
static int64_t bytes;
static fathom_config config;

static void render(double shift) {
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double u = (i % WIDTH - 159.5) / 262 + shift, v = (i / WIDTH - 119.5) / 262;
        double bump = u * u + v * v < 0.04 ? 0.3 - 6 * (u * u + v * v) : 0;
        frame[i] = (uint16_t)(1000 * (1.4 + 0.2 * u - 0.3 * v + (u > 0.35 ? -0.3 : 0) - bump));
    }
}

static void step(int number) {
    fathom_depth_frame f = FATHOM_STRUCT(fathom_depth_frame);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    f.width = WIDTH;
    f.height = HEIGHT;
    f.timestamp_ns = number * 33333333ll;
    f.depth = frame;
    int e = fathom_step(scan, &f, &r);
    if (e != FATHOM_OK) exit(1);
    printf("%s: ", fathom_state_name(r.state));
}

static void open_cold(void) {
    config.cache_folder = "";
    if (fathom_init(&scan, &config, block, (size_t)bytes, NULL, 0) != FATHOM_OK) exit(1);
    printf("fathom_init, kernels built from source: ");
    fathom_close(scan);
    config.cache_folder = NULL;
}

static void open_warm(void) {
    if (fathom_init(&scan, &config, block, (size_t)bytes, NULL, 0) != FATHOM_OK) exit(1);
    printf("fathom_init, kernels from the cache: ");
}

static void first(void) {
    render(0);
    step(1);
}

static void next(void) {
    render(0.004);
    step(2);
}

static void far(void) {
    render(0.5);
    step(3);
}

static int ignore(void *user, const fathom_vertex *vertices, size_t count) {
    (void)user, (void)vertices, (void)count;
    return 0;
}

static void mesh(void) {
    if (fathom_extract_mesh(scan, 0, ignore, NULL) <= 0) exit(1);
    printf("fathom_extract_mesh: ");
}

static void *call(void *function) {
    (*(void (**)(void))function)();
    return NULL;
}

/* Runs the function on a painted stack. */
static void measure(void (*function)(void)) {
    static unsigned char *stack;
    pthread_attr_t attributes;
    pthread_t thread;
    if (!stack && posix_memalign((void **)&stack, 4096, STACK)) exit(1);
    memset(stack, PAINT, STACK);
    pthread_attr_init(&attributes);
    pthread_attr_setstack(&attributes, stack, STACK);
    if (pthread_create(&thread, &attributes, call, &function)) exit(1);
    pthread_join(thread, NULL);
    pthread_attr_destroy(&attributes);
    size_t left = 0;
    while (left < STACK && stack[left] == PAINT) left++;
    printf("%zu KB\n", (STACK - left + 1023) / 1024);
}

int main(void) {
    fathom_config_init(&config);
    config.depth_camera.width = WIDTH;
    config.depth_camera.height = HEIGHT;
    config.depth_camera.fx = config.depth_camera.fy = 262;
    config.depth_camera.cx = 159.5f;
    config.depth_camera.cy = 119.5f;
    bytes = fathom_memory_required(&config, NULL, 0);
    block = bytes > 0 ? malloc((size_t)bytes) : NULL;
    if (!block) return 1;
    void (*const calls[])(void) = {open_cold, open_warm, first, next, far, mesh};
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++) measure(calls[i]);
    fathom_close(scan);
    free(block);
    return 0;
}
