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

# ---- whole scans: init, a first frame, tracked ones, a blank one, one that is looked for in vain, a mesh and a view; the
# larger scan is slow here and does without the search and without looking for races, which the small one shows

fathom=$build/fathom

# scan WIDTHxHEIGHT FRAMES OUTAGE OPTIONS...: options are Oclgrind's
scan() {
    size=$1 frames=$2 outage=$3
    shift 3
    "$fathom" simulate room "$work/$size" --size "$size" --frames 60 --still 0 --clean >"$work/out" 2>&1 || return 1
    # a few frames, and at the end of five one from elsewhere
    awk -v n="$frames" -v k=0 '/^#/ { next } { stamp[k] = $1; file[k++] = $2 }
        END { for (i = 0; i < n; i++) print stamp[i], (i < n - 1 || n < 5 ? file[i] : file[k - 1]) }' "$work/$size/depth.txt" >"$work/few" &&
        mv "$work/few" "$work/$size/depth.txt"
    XDG_CACHE_HOME="$work" timeout 300 oclgrind --check-api --max-errors 100 --log "$work/log-$size" "$@" \
        "$fathom" replay "$work/$size" --imu none --voxel 0.06 --memory 24 --outage "$outage" \
        --stats "$work/$size.csv" --mesh "$work/$size.ply" --picture "$work/$size.png" >"$work/out" 2>&1
}

# states CSV: the second column, as one word
states() { tail -n +2 "$1" | cut -d, -f2 | cut -c1-2 | tr -d '\n'; }

# judge STATUS STATES TEXT: the states of the frames as a pattern, the outcome, and what Oclgrind found
judge() {
    cat "$work/$size.csv" >>"$work/out" 2>/dev/null
    [ "$1" -eq 0 ] && echo "$(states "$work/$size.csv")" | grep -qxE "$2" &&
        [ "$(head -c 400 "$work/$size.ply" | sed -n 's/^element face //p')" -gt 100 ] && [ -s "$work/$size.png" ]
    check "a scan of $size under Oclgrind: $3, a mesh, a view" "$work/out"
    clean "$work/log-$size"
    check "a scan of $size under Oclgrind: no invalid access, no data race, no wrong API call" "$work/faults"
}

scan 64x48 5 3:4 --data-races
judge $? '(fi)(tr)+(re|lo)+' "first, tracked, blank and lost frames"
scan 160x120 4 2:3
judge $? '(fi)(tr)(re)(re|lo|tr)' "first, tracked and blank frames"

echo "1..$number"
[ $failed -eq 0 ]
