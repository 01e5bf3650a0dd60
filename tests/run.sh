#!/bin/sh
# Runs all tests of a build and counts: tests/run.sh BUILD. The last line is "N passed, N failed" (", N skipped").
# Each program prints TAP; what fails is shown in full, the rest stays in BUILD/log.
set -u
build=$1
log=$build/log
mkdir -p "$log"
passed=0 failed=0 skipped=0

# run NAME COMMAND...: counts the TAP lines of one program; a program that dies or says nothing counts as a failure.
run() {
    name=$1
    shift
    start=$(date +%s)
    CMOCKA_MESSAGE_OUTPUT=TAP "$@" >"$log/$name.tap" 2>"$log/$name.err" </dev/null
    status=$?
    skip=$(grep -ciE '^ok .*# *skip' "$log/$name.tap")
    good=$(($(grep -cE '^ok ' "$log/$name.tap") - skip))
    bad=$(grep -cE '^not ok ' "$log/$name.tap")
    if [ "$status" -ne 0 ] && [ "$bad" -eq 0 ] || [ $((good + bad + skip)) -eq 0 ]; then
        bad=$((bad + 1))
        echo "not ok - $name ended with status $status" >>"$log/$name.tap"
    fi
    echo "$name: $good passed, $bad failed, $skip skipped ($(($(date +%s) - start)) s)"
    grep -iE '^ok .*# *skip' "$log/$name.tap" | sed 's/^/    /'
    if [ "$bad" -gt 0 ]; then
        grep -E -A6 '^not ok ' "$log/$name.tap" | sed 's/^/    /'
        tail -n 25 "$log/$name.err" | sed 's/^/    /'
    fi
    passed=$((passed + good)) failed=$((failed + bad)) skipped=$((skipped + skip))
}

# once COMMAND...: runs it again when the leak checker itself crashed, as it does when a runtime's thread ends under it.
once() {
    "$@" && return
    status=$?
    grep -q "LeakSanitizer has encountered a fatal error" "$log/$name.err" || return $status
    "$@"
}

san() { # the same under the sanitizers; the OpenCL runtime's own leaks are not ours
    name=$1
    shift
    ASAN_OPTIONS=detect_leaks=1 LSAN_OPTIONS=suppressions=tests/support/lsan.supp:print_suppressions=0 \
        UBSAN_OPTIONS=print_stacktrace=1 run "$name" once "$@"
}

for t in tests/unit/*/test_*.c; do
    name=$(basename "$t" .c)
    [ -x "$build/tests/$name" ] || { echo "$name: not in this build" && continue; }
    run "$name" "$build/tests/$name"
    san "$name-sanitized" "$build/sanitize/tests/$name"
done
for t in tests/e2e/*.sh; do run "e2e_$(basename "$t" .sh)" sh "$t" "$build"; done

echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
