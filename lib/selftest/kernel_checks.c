#include "selftest/kernel_checks.h"

#include "selftest/kernel_checks_bench.h"

const kernel_check kernel_checks[] = {
    {"convert_depth", check_convert_depth, true},
    {"smooth_depth", check_smooth_depth, true},
    {"halve_depth", check_halve_depth, true},
    {"normal_map", check_normal_map, true},
    {"pack_map", check_pack_map, true},
    {"halve_map", check_halve_map, true},
    {"align_reduce", check_align_reduce, true},
    {"align_reduce, not finite", check_align_not_finite, true},
    {"request_blocks", check_request_blocks, true},
    {"clear_blocks", check_clear_blocks, false},
    {"mark_seen", check_mark_seen, false},
    {"pack_planes", check_pack_planes, true},
    {"fuse_blocks", check_fuse_blocks, true},
    {"clear_ranges", check_clear_ranges, false},
    {"range_blocks", check_range_blocks, false},
    {"raycast", check_raycast, false},
    {"raycast_near", check_raycast_near, false},
    {"count_triangles", check_count_triangles, false},
    {"emit_triangles", check_emit_triangles, false},
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
