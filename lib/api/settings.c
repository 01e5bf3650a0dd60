#include "api/settings.h"

#include <string.h>

#include "api/settings_table.h"
#include "base/log.h"
#include "base/se3.h"

fathom_config config_default(void) {
    fathom_config c;
    memset(&c, 0, sizeof c);
    c.struct_size = sizeof c;
    for (int i = 0; i < settings_count; i++) setting_store(&settings_table[i], &c, settings_table[i].value);
    return c;
}

fathom_config config_preset(int32_t preset) {
    static const struct {
        int32_t preset;
        const char *name;
        double value;
    } differences[] = {
        {FATHOM_PRESET_TINY, "max_align_width", 160}, {FATHOM_PRESET_TINY, "voxel_m", 0.02},
        {FATHOM_PRESET_TINY, "max_memory_bytes", 64 << 20},
        {FATHOM_PRESET_LARGE, "max_align_width", 640}, {FATHOM_PRESET_LARGE, "voxel_m", 0.008},
        {FATHOM_PRESET_LARGE, "max_memory_bytes", 256 << 20},
    };
    fathom_config c = config_default();
    for (size_t i = 0; i < sizeof differences / sizeof *differences; i++)
        if (differences[i].preset == preset)
            setting_store(settings_find(differences[i].name), &c, differences[i].value);
    return c;
}

/* ---- check ------------------------------------------------------------------------------------------------------- */

static int refuse(const fathom_config *c, const setting_row *row) {
    char value[64], range[96];
    setting_print(row, c, value, sizeof value);
    setting_print_range(row, range, sizeof range);
    const char *space = *row->unit ? " " : "";
    log_write(c, FATHOM_LOG_ERROR, "setting %s is %s%s%s; its range is %s%s%s", row->name, value, space,
              row->unit, range, space, row->unit);
    return FATHOM_ERROR_CONFIG;
}

static int refuse_all_zero(const fathom_config *c, const char *name) {
    log_write(c, FATHOM_LOG_ERROR, "setting %s is 0 at every level; one of them must be 1 or more", name);
    return FATHOM_ERROR_CONFIG;
}

/* Settings that are each valid but contradict each other. */
static int check_together(const fathom_config *c) {
    const int32_t *free_budget = c->max_iterations, *seeded = c->max_seeded_iterations;
    const double *k = c->depth_camera.coefficients;
    const int used[] = {0, 5, 8}; /* coefficients, by lens */
    if (c->max_depth_m < c->min_depth_m) {
        log_write(c, FATHOM_LOG_ERROR, "setting max_depth_m is %g m, less than min_depth_m, %g m",
                  c->max_depth_m, c->min_depth_m);
        return FATHOM_ERROR_CONFIG;
    }
    if (free_budget[0] + free_budget[1] + free_budget[2] < 1) return refuse_all_zero(c, "max_iterations");
    if (seeded[0] + seeded[1] + seeded[2] < 1) return refuse_all_zero(c, "max_seeded_iterations");
    for (int i = used[c->depth_camera.lens]; i < 8; i++)
        if (k[i] != 0) {
            log_write(c, FATHOM_LOG_ERROR,
                      "setting depth_camera.coefficients[%d] is %g; depth_camera.lens %d doesn't use it", i,
                      k[i], c->depth_camera.lens);
            return FATHOM_ERROR_CONFIG;
        }
    pose given;
    double mounting[16] = {0};
    mounting[15] = 1;
    for (int i = 0; i < 9; i++) mounting[i / 3 * 4 + i % 3] = c->imu_to_camera_rotation[i];
    if (!pose_take(&c->first_pose, &given) || !pose_from_matrix(mounting, &given)) {
        log_write(c, FATHOM_LOG_ERROR,
                  "first_pose or imu_to_camera_rotation is not a right-handed rigid motion");
        return FATHOM_ERROR_CONFIG;
    }
    return FATHOM_OK;
}

int config_check(const fathom_config *c) {
    for (int i = 0; i < settings_count; i++)
        if (!setting_allows(&settings_table[i], setting_value(&settings_table[i], c)))
            return refuse(c, &settings_table[i]);
    return check_together(c);
}
