#!/bin/sh
# Devices that can do less than this machine's: a library in between makes the device here say so of itself. (It shows what
# fathom does about what it is told, not how such a device computes.) Usage: sh tests/e2e/devices.sh BUILD_DIR. Prints TAP.
set -u
. "$(dirname "$0")/../support/command.sh"

cat >less.c <<'END'
#define _GNU_SOURCE
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
static const struct { cl_device_info what; const char *name; size_t size; } all[] = {
    {CL_DEVICE_TYPE, "TYPE", sizeof(cl_device_type)},
    {CL_DEVICE_MAX_WORK_GROUP_SIZE, "GROUP", sizeof(size_t)},
    {CL_DEVICE_LOCAL_MEM_SIZE, "LOCAL", sizeof(cl_ulong)},
    {CL_DEVICE_COMPILER_AVAILABLE, "COMPILER", sizeof(cl_bool)}};
cl_int clGetDeviceInfo(cl_device_id d, cl_device_info what, size_t size, void *value, size_t *got) {
    cl_int (*next)(cl_device_id, cl_device_info, size_t, void *, size_t *) = dlsym(RTLD_NEXT, "clGetDeviceInfo");
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        const char *said = what == all[i].what ? getenv(all[i].name) : NULL;
        if (!said || !value) continue;
        cl_ulong number = strtoul(said, NULL, 0);
        memcpy(value, &number, all[i].size);
        return CL_SUCCESS;
    }
    return next(d, what, size, value, got);
}
END
if ! cc -shared -fPIC -w -o less.so less.c -ldl >err 2>&1; then
    skip "lesser devices" "nothing can be put in between: $(tail -n 1 err)"
    exit 0
fi

# replay NAME VARIABLES...: what a device that says so makes of the recording.
replay() {
    name=$1
    shift
    mkdir -p "cache-$name"
    env LD_PRELOAD="$work/less.so" XDG_CACHE_HOME="$work/cache-$name" "$@" \
        "$fathom" replay room --size 80x60 --voxel 0.04 --memory 48 >"$name.out" 2>"$name.err"
}
tracked() { grep -q "frames=8 tracked=8" "$1.out"; }

"$fathom" simulate room room --frames 8 --size 160x120 >out 2>err
check "a recording"
replay gpu TYPE=4 && tracked gpu
check "a GPU: groups that add up in local memory, buffers on the device" gpu.err gpu.out
replay small TYPE=4 GROUP=16 && tracked small
check "a GPU with work-groups of 16 at most" small.err small.out
replay local TYPE=4 LOCAL=0 && tracked local
check "a GPU without local memory" local.err local.out
replay compiler COMPILER=0
[ $? -eq 1 ] && grep -q "has no compiler" compiler.err
check "a device without a compiler is refused, and what would help is named" compiler.err

[ $failed -eq 0 ]
