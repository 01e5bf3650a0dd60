#include "selftest/kernel_checks.h"

#include "selftest/kernel_checks_bench.h"

const kernel_check kernel_checks[] = {
    {"convert_depth", check_convert_depth},
    {"smooth_depth", check_smooth_depth},
    {"halve_depth", check_halve_depth},
    {"normal_map", check_normal_map},
    {"pack_map", check_pack_map},
    {"halve_map", check_halve_map},
    {"align_reduce", check_align_reduce},
    {"align_reduce, not finite", check_align_not_finite},
    {"request_blocks", check_request_blocks},
    {"clear_blocks", check_clear_blocks},
    {"pack_planes", check_pack_planes},
    {"fuse_blocks", check_fuse_blocks},
    {"clear_ranges", check_clear_ranges},
    {"range_blocks", check_range_blocks},
    {"raycast", check_raycast},
    {"raycast_near", check_raycast_near},
    {"count_triangles", check_count_triangles},
    {"emit_triangles", check_emit_triangles},
};

const int kernel_check_count = sizeof kernel_checks / sizeof kernel_checks[0];

int kernel_checks_open(device *d, const fathom_config *config, kernel_shape shape) {
    int e = device_choose(d, config);
    if (e != FATHOM_OK) return e;
    if (shape == SHAPE_OTHER && d->cpu) d->wide = d->wide == 16 ? 8 : 16; /* before the kernels are built */
    if (shape == SHAPE_GPU) {
        d->cpu = false;
        d->lanes = d->wide = 1;
        d->group = 64;
    }
    return device_open(d);
}
