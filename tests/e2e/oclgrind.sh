#!/bin/sh
# The kernel checks and whole small scans under Oclgrind, a simulator that sees every access beyond a buffer's end, every
# data race and every wrong API call. Usage: sh tests/e2e/oclgrind.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"

build=${1:?usage: sh tests/e2e/oclgrind.sh BUILD_DIR}
text="kernels under Oclgrind"
if ! command -v oclgrind >/dev/null 2>&1; then
    echo "ok 1 - $text # SKIP no oclgrind"
    exit 0
fi
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-oclgrind-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM

# Oclgrind 21.10 itself crashes with --uninitialized, on selections between vectors.
# The folder for kernel caches is new: Oclgrind must compile what is there now.
FATHOM_CHECK_SIZE=small CMOCKA_MESSAGE_OUTPUT=TAP XDG_CACHE_HOME="$work" timeout 300 \
    oclgrind --check-api --data-races --max-errors 100000 --log "$work/log" "$build/tests/test_kernels" \
    >"$work/out" 2>"$work/err"
status=$?
cat "$work/err" >>"$work/out"
[ $status -eq 0 ] && ! grep -q '^not ok' "$work/out" && grep -q 'Oclgrind)$' "$work/out"
check "$text: they do what the reference does ($(grep -c '^ok' "$work/out") checks)" "$work/out"

# clean LOG: nothing was found; what was is left in $work/faults. A message is a paragraph or a line. One race is meant:
# range_blocks reads a range before it changes it by an atomic minimum or maximum, to spare the atomic where nothing would
# change; whatever it reads, the outcome is the same.
clean() {
    awk -v RS= '!(/data race/ && /Kernel: *range_blocks/ && /load volatile/ && /atomic_m(in|ax)/)' "$1" >"$work/faults"
    [ -e "$1" ] && [ ! -s "$work/faults" ]
}
clean "$work/log"
check "$text: no invalid access, no data race, no wrong API call" "$work/faults"

# ---- whole scans: init, steps, a mesh, a view

root=$(cd "$(dirname "$0")/../.." && pwd)
${CC:-cc} -std=c11 -Wall -Wextra -o "$work/small_scan" -I"$root/lib" "$root/tests/e2e/programs/small_scan.c" "$build/libfathom.a" \
    -lOpenCL -lstdc++ -lpthread -lm >"$work/out" 2>&1
check "a small scan is built" "$work/out"

# scan TEXT STATES WIDTH HEIGHT FRAMES: what its frames must become, and nothing for Oclgrind to find.
scan() {
    text="a scan of $3x$4, $1" states=$2
    rm -f "$work/log"
    XDG_CACHE_HOME="$work" timeout 300 oclgrind --check-api --data-races --max-errors 100000 --log "$work/log" \
        "$work/small_scan" "$3" "$4" "$5" >"$work/out" 2>&1 && grep -qx "$states" "$work/out"
    check "$text: it goes as it should" "$work/out"
    clean "$work/log"
    check "$text: no invalid access, no data race, no wrong API call" "$work/faults"
}

scan "tracked and blank frames" "first fused, tracked fused, reckoned" 64 48 ssb
scan "a frame that is looked for in vain" "first fused, reckoned searched" 64 48 se
scan "tracked and blank frames" "first fused, tracked fused, reckoned" 160 120 ssb

echo "1..$number"
[ $failed -eq 0 ]
