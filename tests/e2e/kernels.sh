#!/bin/sh
# Built kernels from a file: no compiler runs on the board. A trap in the process's way to other programs shows whether one
# is started. Usage: sh tests/e2e/kernels.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"

cat >trap.c <<'END'
#include <spawn.h>
#include <unistd.h>
static void sprung(void) { if (write(2, "a compiler was started\n", 23)) _exit(99); }
pid_t fork(void) { sprung(); return -1; }
pid_t vfork(void) { sprung(); return -1; }
int execve(const char *p, char *const a[], char *const e[]) { (void)p, (void)a, (void)e; sprung(); return -1; }
int posix_spawn(pid_t *p, const char *f, const posix_spawn_file_actions_t *x, const posix_spawnattr_t *y, char *const a[],
                char *const e[]) { (void)p, (void)f, (void)x, (void)y, (void)a, (void)e; sprung(); return 1; }
END
if ! cc -shared -fPIC -w -o trap.so trap.c >err 2>&1; then
    skip "built kernels" "no trap can be built: $(tail -n 1 err)"
    exit 0
fi

settings="--size 80x60 --voxel 0.04 --memory 32"

# on NAME COMMAND...: the command with the caches of a machine called so.
on() {
    mkdir -p "caches/$1"
    caches=$work/caches/$1
    shift
    POCL_CACHE_DIR=$caches XDG_CACHE_HOME=$caches "$fathom" "$@" >out 2>err
}

on here simulate room room --frames 6 --size 160x120
check "a recording"
# shellcheck disable=SC2086
on here kernels all.bin --depth 160x120 $settings && [ -s all.bin ]
check "kernels are built and written"

# shellcheck disable=SC2086
LD_PRELOAD=$work/trap.so on board replay room $settings --kernels all.bin --mesh with.ply
check "with them, on empty caches, no compiler is started"
# shellcheck disable=SC2086
LD_PRELOAD=$work/trap.so on bare replay room $settings
grep -q "compiler was started" err
check "without them one is: the trap works"

# shellcheck disable=SC2086
on here replay room $settings --mesh without.ply && cmp with.ply without.ply >>err 2>&1
check "they find the same surface"

head -c 1000 all.bin >cut.bin
for file in cut.bin none.bin; do
    # shellcheck disable=SC2086
    on here replay room $settings --kernels $file
    [ $? -eq 1 ] && grep -q "$file" err
    check "$file, which can't be used, is refused by name"
done

[ $failed -eq 0 ]
