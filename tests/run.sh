#!/bin/sh
# Runs all tests of a build and counts: tests/run.sh BUILD [PATTERN]. The last line is "N passed, N failed" (", N skipped").
# PATTERN, an extended regular expression, picks programs by their names.
# Each program prints TAP; what fails is shown in full, the rest stays in BUILD/log. As many programs run at a time as
# there are processors (JOBS=); what each says is kept whole, and shown in the order of their names.
set -u
build=$1
log=$build/log
here=$(cd "$(dirname "$0")" && pwd)

# ---- one program: sh tests/run.sh BUILD --one NAME KIND COMMAND...

# The machine's own OpenCL platforms, for the kernel checks; all else uses PoCL alone where it is installed, and so does what runs
# under the sanitizers: another vendor's runtime leaks as it goes, from modules that are unloaded when leaks are looked for.
machine() { if [ "${MACHINE_ICD_VENDORS-}" ]; then OCL_ICD_VENDORS=$MACHINE_ICD_VENDORS "$@"; else env -u OCL_ICD_VENDORS "$@"; fi; }

# Runs it again when the leak checker itself crashed, as it does when a runtime's thread ends under it.
once() {
    "$@" && return
    status=$?
    grep -q "LeakSanitizer has encountered a fatal error" "$log/$name.err" || return $status
    "$@"
}

# Under the sanitizers; the OpenCL runtimes' own leaks are not ours.
san() {
    ASAN_OPTIONS=detect_leaks=1 LSAN_OPTIONS=suppressions=tests/support/lsan.supp:print_suppressions=0 \
        UBSAN_OPTIONS=print_stacktrace=1 once "$@"
}

# Counts the TAP lines; a program that dies or says nothing counts as a failure.
one() {
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
    {
        echo "$name: $good passed, $bad failed, $skip skipped ($(($(date +%s) - start)) s)"
        grep -iE '^ok .*# *skip' "$log/$name.tap" | sed 's/^/    /'
        if [ "$bad" -gt 0 ]; then
            grep -E -A6 '^not ok ' "$log/$name.tap" | sed 's/^/    /'
            tail -n 25 "$log/$name.err" | sed 's/^/    /'
        fi
    } >"$log/$name.said"
    echo "$good $bad $skip" >"$log/$name.part"
    mv "$log/$name.part" "$log/$name.count" # there and whole
}

if [ "${2-}" = --one ]; then
    shift 2
    one "$@"
    exit 0
fi

# ---- all of them

jobs=${JOBS:-$(nproc 2>/dev/null || echo 1)}
rm -rf "$log"
mkdir -p "$log/vendors"

# An OpenCL platform of another vendor leaks and races in its own ways.
export MACHINE_ICD_VENDORS="${OCL_ICD_VENDORS-}"
if ls "${OCL_ICD_VENDORS:-/etc/OpenCL/vendors}"/pocl*.icd >/dev/null 2>&1; then
    cp "${OCL_ICD_VENDORS:-/etc/OpenCL/vendors}"/pocl*.icd "$log/vendors/"
    OCL_ICD_VENDORS=$(cd "$log/vendors" && pwd)/
    export OCL_ICD_VENDORS
fi

# The list of all runs, a line each: name, command.
list() {
    for t in "$here"/unit/*/test_*.c; do
        name=$(basename "$t" .c)
        all=
        [ "$name" != test_kernels ] || all=machine
        if [ -x "$build/tests/$name" ]; then
            echo "$name $all $build/tests/$name"
            echo "$name-sanitized san $build/sanitize/tests/$name"
        else
            echo "$name: not in this build" >&2
        fi
    done | sort
    for t in "$here"/e2e/*.sh; do echo "e2e_$(basename "$t" .sh) sh $t $build"; done
}
list | grep -E -e "${2-.}" >"$log/list"

# The longest begin first, so that none is left alone at the end.
longest="e2e_judge e2e_accuracy e2e_fuzz e2e_thread_sanitizer e2e_reproduce"
{
    for name in $longest; do grep "^$name " "$log/list"; done
    for name in $longest; do echo "^$name "; done | grep -v -f - "$log/list"
} >"$log/queue"

xargs -P "$jobs" -L 1 sh "$0" "$build" --one <"$log/queue" &
workers=$!
trap 'trap - INT TERM; kill $workers 2>/dev/null; exit 130' INT TERM

passed=0 failed=0 skipped=0
while read -r name command; do
    while [ ! -e "$log/$name.count" ]; do
        sleep 0.2
        if ! kill -0 $workers 2>/dev/null && [ ! -e "$log/$name.count" ]; then
            echo "$name: 0 passed, 1 failed, 0 skipped: it was not run ($command)" >"$log/$name.said"
            echo "0 1 0" >"$log/$name.count"
        fi
    done
    cat "$log/$name.said"
    read -r good bad skip <"$log/$name.count"
    passed=$((passed + good)) failed=$((failed + bad)) skipped=$((skipped + skip))
done <"$log/list"
wait $workers

echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
