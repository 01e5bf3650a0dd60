/* Checks whether an assumed depth scale is likely. */
#include "recording/recording_internal.h"
#include "recording/image_file.h"

#include <math.h>
#include <stdlib.h>

#define LOOKED_AT 5 /* frames, spread over the recording */

/* The median depth of those frames in units, 0 when they are empty. Frames that can't be read are skipped: reading them
 * later reports the error. */
static int median_units(const struct recording *recording, uint16_t *pixels, uint32_t *histogram) {
    const fathom_recording *shown = &recording->shown;
    const size_t capacity = (size_t)shown->camera.width * (size_t)shown->camera.height;
    uint64_t count = 0, below = 0;
    for (int i = 0; i < LOOKED_AT; i++) {
        char error[64];
        int width = 0, height = 0;
        const int index = (int)((int64_t)(shown->frame_count - 1) * i / (LOOKED_AT - 1));
        char *path = recording_path(recording, shown->frames[index].file);
        const bool read =
            path && !image_read_gray16(path, pixels, capacity, &width, &height, error, sizeof error);
        free(path);
        for (size_t p = 0; read && p < (size_t)width * (size_t)height; p++)
            if (pixels[p] != 0 && pixels[p] != 65535) {
                histogram[pixels[p]]++;
                count++;
            }
    }
    int units = 0;
    while (count && units < 65535 && 2 * (below += histogram[units]) < count) units++;
    return units;
}

int recording_judge_depth_scale(struct recording *recording) {
    static const double usual[] = {1000, 5000, 10000, 100};
    const fathom_recording *shown = &recording->shown;
    uint16_t *pixels = malloc((size_t)shown->camera.width * (size_t)shown->camera.height * sizeof *pixels);
    uint32_t *histogram = calloc(65536, sizeof *histogram);
    const int units = pixels && histogram ? median_units(recording, pixels, histogram) : -1;
    free(pixels);
    free(histogram);
    if (units < 0) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", shown->folder);
    const double median = units / shown->depth_units_per_metre;
    if (units == 0 || (median >= 0.5 && median <= 8)) return FATHOM_OK;

    /* The likelier scale is the usual one that puts the median nearest to 2 m, an ordinary room's. */
    double likelier = usual[0];
    for (size_t i = 1; i < sizeof usual / sizeof *usual; i++)
        if (fabs(log(units / usual[i] / 2)) < fabs(log(units / likelier / 2))) likelier = usual[i];
    recording_say(recording, FATHOM_LOG_WARNING,
                  "%s: nothing states the depth scale, and at %g units a metre the median depth is %.2f m; "
                  "%g is likelier (%.2f m)",
                  shown->folder, shown->depth_units_per_metre, median, likelier, units / likelier);
    return FATHOM_OK;
}
