#include "fathom/files/picture.h"
#include "fathom/shell/cli.h"
#include "fathom/files/overview.h"
#include "fathom/files/png_file.h"
#include "fathom/files/shade.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fathom/files/view.h"

#define WIDTH 1280
#define HEIGHT 960

struct canvas {
    fathom_view view;
    uint8_t *rgb;
    float *depth, *normals;
    float *ink;     /* fraction of a pixel that the line covers, 0..1 */
    uint8_t *state; /* whose colour it is */
};

/* Okabe and Ito's colours, which colour-blind people can distinguish, too. */
static const uint8_t colours[4][3] = {
    [FATHOM_FIRST] = {0, 114, 178},
    [FATHOM_TRACKED] = {0, 114, 178},
    [FATHOM_RECKONED] = {240, 150, 0},
    [FATHOM_LOST] = {213, 40, 0},
};

static int clamp(float value, int low, int high) {
    return !(value > (float)low) ? low : value > (float)high ? high : (int)value;
}

/* Inks every pixel by the fraction that the thick line from a to b (pixels and depth; a dot when they are the same)
 * covers. Takes the maximum with the pixel's present ink, so that joints of a line don't show. */
static void ink_line(struct canvas *canvas, const float a[3], const float b[3], float half_width,
                     fathom_state state) {
    const int left = clamp(fminf(a[0], b[0]) - half_width - 1, 0, WIDTH),
              top = clamp(fminf(a[1], b[1]) - half_width - 1, 0, HEIGHT);
    const int right = clamp(fmaxf(a[0], b[0]) + half_width + 2, 0, WIDTH);
    const int bottom = clamp(fmaxf(a[1], b[1]) + half_width + 2, 0, HEIGHT);
    const float along[2] = {b[0] - a[0], b[1] - a[1]};
    const float length2 = along[0] * along[0] + along[1] * along[1];
    for (int v = top; v < bottom; v++)
        for (int u = left; u < right; u++) {
            const float x = (float)u - a[0], y = (float)v - a[1];
            float s = length2 > 0 ? (x * along[0] + y * along[1]) / length2 : 0;
            s = fminf(fmaxf(s, 0), 1);
            const float distance = hypotf(x - s * along[0], y - s * along[1]);
            float ink = fminf(fmaxf(half_width + 0.5f - distance, 0), 1);
            const size_t pixel = (size_t)v * WIDTH + (size_t)u;
            const float surface = canvas->depth[pixel];
            if (surface > 0 && surface < a[2] + s * (b[2] - a[2])) ink *= 0.35f; /* behind the surface */
            if (ink > canvas->ink[pixel]) {
                canvas->ink[pixel] = ink;
                canvas->state[pixel] = (uint8_t)state;
            }
        }
}

/* Blends the ink into the image and clears it for the next layer. */
static void blend(struct canvas *canvas, const uint8_t *one_colour, float strength) {
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++) {
        const float ink = canvas->ink[i] * strength;
        if (!(ink > 0)) continue;
        const uint8_t *colour = one_colour ? one_colour : colours[canvas->state[i]];
        for (int k = 0; k < 3; k++) {
            uint8_t *value = &canvas->rgb[3 * i + (size_t)k];
            *value = (uint8_t)lrintf((1 - ink) * (float)*value + ink * (float)colour[k]);
        }
        canvas->ink[i] = 0;
    }
}

static void ink_path(struct canvas *canvas, const struct path *path, float half_width) {
    float before[3], now[3];
    bool have_before = false;
    for (int i = 0; i < path->count; i++) {
        const fathom_state state = path->points[i].state;
        float position[3];
        for (int k = 0; k < 3; k++) position[k] = (float)path->points[i].pose.position[k];
        const bool have_now = view_project(&canvas->view, position, now);
        if (have_now && have_before) ink_line(canvas, before, now, half_width, state);
        if (have_now && (i == 0 || i == path->count - 1)) ink_line(canvas, now, now, half_width + 4, state);
        memcpy(before, now, sizeof before);
        have_before = have_now;
    }
}

static int draw(fathom *context, const struct path *path, struct canvas *canvas) {
    static const uint8_t white[3] = {255, 255, 255};
    canvas->view = view_of(WIDTH, HEIGHT, 1.1);
    int result = overview_choose(context, path, &canvas->view);
    if (result >= 0) result = fathom_cast_view(context, &canvas->view, canvas->depth, canvas->normals);
    if (result < 0) return result;
    shade(canvas->depth, canvas->normals, (size_t)WIDTH * HEIGHT, canvas->rgb);
    /* A light rim makes the path visible on dark and light surfaces. */
    ink_path(canvas, path, 3.2f);
    blend(canvas, white, 0.8f);
    ink_path(canvas, path, 1.8f);
    blend(canvas, NULL, 1);
    return FATHOM_OK;
}

bool picture_write(fathom *context, const struct path *path, const char *file) {
    const size_t pixels = (size_t)WIDTH * HEIGHT;
    struct canvas canvas = {.rgb = malloc(3 * pixels),
                            .depth = malloc(pixels * sizeof(float)),
                            .normals = malloc(3 * pixels * sizeof(float)),
                            .ink = calloc(pixels, sizeof(float)),
                            .state = calloc(pixels, 1)};
    int result = FATHOM_ERROR_MEMORY;
    if (canvas.rgb && canvas.depth && canvas.normals && canvas.ink && canvas.state)
        result = draw(context, path, &canvas);
    if (result == FATHOM_ERROR_NO_DATA)
        cli_error(CLI_FAILED, "%s: no surface to draw", file);
    else if (result < 0)
        cli_error(CLI_FAILED, "%s: %s", file, fathom_error_name(result));
    const bool written = result >= 0 && png_write_rgb(file, canvas.rgb, WIDTH, HEIGHT);
    free(canvas.rgb);
    free(canvas.depth);
    free(canvas.normals);
    free(canvas.ink);
    free(canvas.state);
    return written;
}
