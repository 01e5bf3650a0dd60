/* Which OpenCL device is taken, and in which shape its kernels are built, over platforms that this program makes up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "cl/device.h"

/* ---- OpenCL as the library asks it ---- */

struct _cl_device_id {
    const char *name;
    cl_device_type type;
    cl_bool unified, unavailable;
    cl_uint vector;
    size_t group;
    cl_ulong local;
};

struct _cl_platform_id {
    const char *name;
    struct _cl_device_id devices[4];
    cl_uint count;
};

static struct _cl_platform_id platforms[3];
static cl_uint platform_count;

cl_int clGetPlatformIDs(cl_uint most, cl_platform_id *ids, cl_uint *count) {
    for (cl_uint i = 0; i < platform_count && i < most; i++) ids[i] = &platforms[i];
    *count = platform_count;
    return platform_count ? CL_SUCCESS : -1001;
}

/* Writes all of the room that is given, as a runtime may. */
static cl_int give_name(const char *name, size_t size, void *value) {
    memset(value, 0, size);
    memcpy(value, name, strlen(name) < size ? strlen(name) : size);
    return CL_SUCCESS;
}

cl_int clGetPlatformInfo(cl_platform_id platform, cl_platform_info what, size_t size, void *value, size_t *needed) {
    (void)needed;
    assert_int_equal(what, CL_PLATFORM_NAME);
    assert_true(size < 128); /* a 0 follows */
    return give_name(platform->name, size, value);
}

cl_int clGetDeviceIDs(cl_platform_id platform, cl_device_type type, cl_uint most, cl_device_id *ids, cl_uint *count) {
    assert_true(type == CL_DEVICE_TYPE_ALL);
    for (cl_uint i = 0; i < platform->count && i < most; i++) ids[i] = &platform->devices[i];
    *count = platform->count;
    return platform->count ? CL_SUCCESS : CL_DEVICE_NOT_FOUND;
}

cl_int clGetDeviceInfo(cl_device_id id, cl_device_info what, size_t size, void *value, size_t *needed) {
    (void)needed;
    const cl_bool available = !id->unavailable;
    const void *from = what == CL_DEVICE_TYPE                      ? (const void *)&id->type
                       : what == CL_DEVICE_HOST_UNIFIED_MEMORY     ? (const void *)&id->unified
                       : what == CL_DEVICE_AVAILABLE               ? (const void *)&available
                       : what == CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT ? (const void *)&id->vector
                       : what == CL_DEVICE_MAX_WORK_GROUP_SIZE     ? (const void *)&id->group
                       : what == CL_DEVICE_LOCAL_MEM_SIZE          ? (const void *)&id->local
                                                                   : NULL;
    if (what == CL_DEVICE_NAME) {
        assert_true(size < 128);
        return give_name(id->name, size, value);
    }
    assert_non_null(from);
    memcpy(value, from, size);
    return CL_SUCCESS;
}

/* ---- tests ---- */

static const struct _cl_device_id cpu = {"Cortex-A57", CL_DEVICE_TYPE_CPU, CL_TRUE, CL_FALSE, 8, 4096, 32768},
                                  own_memory = {"GeForce", CL_DEVICE_TYPE_GPU, CL_FALSE, CL_FALSE, 1, 1024, 49152},
                                  shared_memory = {"Mali-G610", CL_DEVICE_TYPE_GPU, CL_TRUE, CL_FALSE, 4, 1024, 32768};

static void plug(int platform, const char *name, int count, const struct _cl_device_id *a, const struct _cl_device_id *b) {
    platforms[platform] = (struct _cl_platform_id){.name = name, .count = (cl_uint)count};
    if (a) platforms[platform].devices[0] = *a;
    if (b) platforms[platform].devices[1] = *b;
    if (platform_count < (cl_uint)platform + 1) platform_count = (cl_uint)platform + 1;
}

static int usual(void **state) {
    (void)state;
    platform_count = 0;
    plug(0, "Portable Computing Language", 1, &cpu, NULL);
    plug(1, "NVIDIA CUDA", 1, &own_memory, NULL);
    plug(2, "ARM Platform", 1, &shared_memory, NULL);
    return 0;
}

static device choose(const char *wanted, fathom_buffers buffers) {
    static fathom_config c;
    device d;
    fathom_config_init(&c);
    c.device = wanted;
    c.buffers = buffers;
    assert_int_equal(device_choose(&d, &c), FATHOM_OK);
    return d;
}

static void assert_chosen(const char *wanted, const char *name) {
    const device d = choose(wanted, FATHOM_BUFFERS_AUTO);
    assert_string_equal(d.name, name);
    assert_string_equal(d.id->name, name);
    assert_int_equal(d.cpu, d.id->type == CL_DEVICE_TYPE_CPU);
}

static void a_gpu_that_shares_memory_comes_first_then_whatever_is_first(void **state) {
    (void)state;
    assert_chosen(NULL, "Mali-G610");
    assert_chosen("", "Mali-G610");
    platforms[2].devices[0].unified = CL_FALSE;
    assert_chosen(NULL, "Cortex-A57"); /* a CPU's memory is shared, but it is no GPU */
    platforms[0].devices[0].unavailable = CL_TRUE;
    assert_chosen(NULL, "GeForce");
    usual(NULL);
    plug(1, "NVIDIA CUDA", 2, &own_memory, &shared_memory);
    platforms[1].devices[1].name = "Tegra";
    assert_chosen(NULL, "Tegra"); /* the first of two that are as good */
}

static void a_name_or_a_part_of_it_picks_a_device_or_a_platform(void **state) {
    (void)state;
    assert_chosen("geforce", "GeForce");
    assert_chosen("cuda", "GeForce");
    assert_chosen("A57", "Cortex-A57");
    assert_chosen("portable comp", "Cortex-A57");
    assert_chosen("cpu", "Cortex-A57");
    assert_chosen("gpu", "Mali-G610");
    platforms[2].count = 0;
    assert_chosen("gpu", "GeForce");
    device d;
    fathom_config c;
    fathom_config_init(&c);
    c.device = "mali";
    assert_int_equal(device_choose(&d, &c), FATHOM_ERROR_DEVICE);
    platform_count = 0;
    assert_int_equal(device_choose(&d, &c), FATHOM_ERROR_DEVICE);
}

static void names_longer_than_their_room_are_cut(void **state) {
    (void)state;
    char name[301];
    memset(name, 'n', 300);
    name[300] = 0;
    plug(0, name, 1, &cpu, NULL);
    platforms[0].devices[0].name = name;
    platform_count = 1;
    const device d = choose("nnn", FATHOM_BUFFERS_AUTO);
    assert_int_equal(strlen(d.name), 127);
}

static void buffers_lie_in_the_block_by_default_on_a_cpu_only(void **state) {
    (void)state;
    static const struct {
        const char *device;
        fathom_buffers buffers;
        bool in_block;
    } cases[] = {{"cpu", FATHOM_BUFFERS_AUTO, true},     {"gpu", FATHOM_BUFFERS_AUTO, false},
                 {"cpu", FATHOM_BUFFERS_HOST, true},     {"gpu", FATHOM_BUFFERS_HOST, true},
                 {"cpu", FATHOM_BUFFERS_DEVICE, false},  {"gpu", FATHOM_BUFFERS_DEVICE, false}};
    for (int i = 0; i < 6; i++)
        assert_int_equal(choose(cases[i].device, cases[i].buffers).buffers_in_block, cases[i].in_block);
}

static void assert_shape(int lanes, int wide, int group) {
    const device d = choose(NULL, FATHOM_BUFFERS_AUTO);
    assert_int_equal(d.lanes, lanes);
    assert_int_equal(d.wide, wide);
    assert_int_equal(d.group, group);
}

static void kernels_are_built_in_the_shape_of_the_device(void **state) {
    (void)state;
    struct _cl_device_id *d = &platforms[0].devices[0];
    platform_count = 1;
    assert_shape(8, 8, 1);
    d->vector = 16;
    assert_shape(8, 16, 1);
    d->vector = 4;
    assert_shape(8, 8, 1);
    *d = shared_memory;
    assert_shape(1, 1, 64);
    d->group = 64;
    d->local = 1024;
    assert_shape(1, 1, 64);
    d->group = 63;
    assert_shape(1, 1, 1);
    d->group = 64;
    d->local = 1023;
    assert_shape(1, 1, 1);
}

int main(void) {
#define PLUGGED(test) cmocka_unit_test_setup(test, usual)
    const struct CMUnitTest tests[] = {
        PLUGGED(a_gpu_that_shares_memory_comes_first_then_whatever_is_first),
        PLUGGED(a_name_or_a_part_of_it_picks_a_device_or_a_platform),
        PLUGGED(names_longer_than_their_room_are_cut),
        PLUGGED(buffers_lie_in_the_block_by_default_on_a_cpu_only),
        PLUGGED(kernels_are_built_in_the_shape_of_the_device),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
