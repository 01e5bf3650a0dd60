#!/bin/sh
# The kernel checks under Oclgrind, a simulator that sees every access beyond a buffer's end, every data race and every
# wrong API call. Usage: sh tests/e2e/oclgrind.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
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

# A message is a paragraph or a line. One race is meant: range_blocks reads a range before it changes it by an atomic
# minimum or maximum, to spare the atomic where nothing would change; whatever it reads, the outcome is the same.
awk -v RS= '!(/data race/ && /Kernel: *range_blocks/ && /load volatile/ && /atomic_m(in|ax)/)' "$work/log" >"$work/faults"
[ -e "$work/log" ] && [ ! -s "$work/faults" ]
check "$text: no invalid access, no data race, no wrong API call" "$work/faults"

[ $failed -eq 0 ]
