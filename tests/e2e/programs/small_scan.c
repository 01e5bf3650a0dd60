/* A whole small scan through the library's public interface: small_scan WIDTH HEIGHT FRAMES, where FRAMES has a letter a
 * frame: s, the surface from a place a little further on; b, a blank one; e, a surface that is elsewhere. Then a mesh, and
 * views from two sides. Prints each frame's state, 0 for success. For tests/e2e/oclgrind.sh and symbols.sh. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fathom.h"

#define MAX_WIDTH 160
#define MAX_HEIGHT 120

static uint16_t depth[MAX_WIDTH * MAX_HEIGHT];
static int width, height;

static void render(char kind, int number) {
    for (int i = 0; i < width * height; i++) {
        double u = (i % width - 0.5 * (width - 1)) / width * 1.2 + 0.004 * number, v = (i / width - 0.5 * (height - 1)) / width * 1.2;
        double bump = u * u + v * v < 0.04 ? 0.3 - 6 * (u * u + v * v) : 0;
        double z = 1.4 + 0.2 * u - 0.3 * v + (u > 0.35 ? -0.3 : 0) - bump;
        if (kind == 'e') z = 0.8 - 0.5 * u + (v > 0 ? 0.3 : 0);
        depth[i] = kind == 'b' ? 0 : (uint16_t)(1000 * z);
    }
}

static int count_triangles(void *user, const fathom_vertex *vertices, size_t count) {
    (void)vertices;
    *(size_t *)user += count;
    return 0;
}

static int seen(fathom *scan, double z) {
    enum { VIEW_WIDTH = 24, VIEW_HEIGHT = 18 };
    static float view[VIEW_WIDTH * VIEW_HEIGHT], normals[3 * VIEW_WIDTH * VIEW_HEIGHT];
    fathom_view v = FATHOM_STRUCT(fathom_view);
    v.camera = (fathom_pinhole){.width = VIEW_WIDTH, .height = VIEW_HEIGHT, .fx = 20, .fy = 20, .cx = 11.5, .cy = 8.5};
    fathom_get_pose(scan, &v.pose, NULL);
    v.pose.position[2] += z;
    int pixels = 0;
    if (fathom_cast_view(scan, &v, view, normals) != FATHOM_OK) return 0;
    for (int i = 0; i < VIEW_WIDTH * VIEW_HEIGHT; i++) pixels += view[i] > 0;
    return pixels;
}

int main(int argc, char **argv) {
    fathom_config c;
    fathom_config_init(&c);
    char why[256] = "";
    if (argc != 4) return 2;
    width = atoi(argv[1]);
    height = atoi(argv[2]);
    if (width < 16 || width > MAX_WIDTH || height < 16 || height > MAX_HEIGHT) return 2;
    c.depth_camera = (fathom_pinhole){.width = width, .height = height, .fx = width / 1.2, .fy = width / 1.2,
                                      .cx = 0.5 * (width - 1), .cy = 0.5 * (height - 1)};
    c.voxel_m = 0.05f;
    c.max_blocks = 1500;
    c.imu = false;
    fathom *scan = NULL;
    int64_t bytes = fathom_memory_required(&c, why, sizeof why);
    void *block = bytes > 0 ? malloc((size_t)bytes) : NULL;
    if (!block || fathom_init(&scan, &c, block, (size_t)bytes, why, sizeof why) != FATHOM_OK) {
        fprintf(stderr, "%s\n", why);
        return 1;
    }
    for (int i = 0; argv[3][i]; i++) {
        fathom_depth_frame f = FATHOM_STRUCT(fathom_depth_frame);
        fathom_result r = FATHOM_STRUCT(fathom_result);
        render(argv[3][i], i);
        f.width = width;
        f.height = height;
        f.timestamp_ns = (i + 1) * 33333333ll;
        f.depth = depth;
        int e = fathom_step(scan, &f, &r);
        if (e != FATHOM_OK) fprintf(stderr, "%s: %s\n", fathom_error_name(e), fathom_last_error(scan));
        if (e != FATHOM_OK) return 1;
        printf("%s%s%s", fathom_state_name(r.state), r.fused ? " fused" : "", r.searched ? " searched" : "");
        if (argv[3][i + 1]) printf(", ");
    }
    size_t triangles = 0;
    int64_t total = fathom_extract_mesh(scan, 0, count_triangles, &triangles);
    int front = seen(scan, 0), far = seen(scan, -0.5);
    printf("\n%d blocks planned, %zu triangles, %d and %d pixels of views\n", (int)c.max_blocks, triangles, front, far);
    fathom_close(scan);
    free(block);
    return !(total > 100 && (size_t)total == triangles && front > 50 && far > 50);
}
