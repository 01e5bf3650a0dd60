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

# ---- whole scans: init, steps, a mesh and a view

fathom=$build/fathom

# A simulated room; its last frame is one from elsewhere: room WIDTHxHEIGHT FRAMES
room() {
    "$fathom" simulate room "$work/$1" --size "$1" --frames 60 --still 0 --clean >"$work/out" 2>&1 &&
        awk -v n="$2" -v k=0 '/^#/ { next } { stamp[k] = $1; file[k++] = $2 }
            END { for (i = 0; i < n; i++) print stamp[i], (i < n - 1 ? file[i] : file[k - 1]) }' \
            "$work/$1/depth.txt" >"$work/few" && mv "$work/few" "$work/$1/depth.txt"
}

# scan WIDTHxHEIGHT OCLGRIND_OPTIONS REPLAY_OPTIONS...
scan() {
    size=$1 looks=$2
    shift 2
    rm -f "$work/log" "$work/s.csv" "$work/m.ply" "$work/p.png"
    # shellcheck disable=SC2086
    XDG_CACHE_HOME="$work" timeout 300 oclgrind --check-api $looks --max-errors 100 --log "$work/log" \
        "$fathom" replay "$work/$size" --imu none --voxel 0.06 --memory 24 --stats "$work/s.csv" --mesh "$work/m.ply" \
        --picture "$work/p.png" "$@" >"$work/out" 2>&1
}

# judge STATES TEXT, after a scan: the states of its frames as a pattern, what it has written, what Oclgrind has found.
judge() {
    status=$?
    cat "$work/s.csv" >>"$work/out" 2>/dev/null
    tail -n +2 "$work/s.csv" | cut -d, -f2 | cut -c1-2 | tr -d '\n' | grep -qE "^$1$" && [ $status -eq 0 ] &&
        [ "$(head -c 400 "$work/m.ply" | sed -n 's/^element face //p')" -gt 100 ] && [ -s "$work/p.png" ]
    check "a scan of $size under Oclgrind: $2, a mesh, a view" "$work/out"
    clean "$work/log"
    check "the scan of $size, $2: no invalid access, no data race, no wrong API call" "$work/faults"
}

room 64x48 5
scan 64x48 --data-races --outage 3:5
judge 'fi(tr){2}(re){2}' "tracked and blank frames"
# a search makes hundreds of launches; the few kernels of it were looked at for races before
scan 64x48 "" --stride 4 --iterations 1,1,1
judge 'fi(re|lo)' "a frame that is looked for in vain"
room 160x120 4
scan 160x120 "" --outage 2:4
judge 'fitr(re){2}' "first, tracked and blank frames"

echo "1..$number"
[ $failed -eq 0 ]
