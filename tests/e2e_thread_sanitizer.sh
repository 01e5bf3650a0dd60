#!/bin/sh
# Builds what uses two threads with the thread sanitizer and runs it: tests/e2e_thread_sanitizer.sh BUILD. Prints TAP.
set -u
build=$1
tsan=$build/tsan
cd "$(dirname "$0")/.." || exit 1
number=0
mkdir -p "$tsan"

# case NAME STATUS OUTPUT...: one TAP line; what a failure printed goes to stderr
outcome() {
    number=$((number + 1))
    if [ "$2" -eq 0 ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        tail -n 60 "$3" >&2
    fi
}

echo "1..4"
printf 'int main(void) { return 0; }\n' >"$tsan/probe.c"
if ! ${CC:-cc} -fsanitize=thread -o "$tsan/probe" "$tsan/probe.c" 2>"$tsan/probe.log" || ! "$tsan/probe" 2>>"$tsan/probe.log"; then
    for i in 1 2 3 4; do echo "ok $i - thread sanitizer # SKIP the compiler's thread sanitizer doesn't work here"; done
    exit 0
fi

make BUILD="$tsan" SANITIZE=thread OPTIMISE='-O1 -g' "$tsan/tests/test_inertial" "$tsan/tests/test_api_step" \
    "$tsan/tests/test_api_device" >"$tsan/make.log" 2>&1
status=$?
outcome "builds with the thread sanitizer" $status "$tsan/make.log"
if [ $status -ne 0 ]; then
    for i in 2 3 4; do echo "not ok $i - not built"; done
    exit 1
fi

# race PROGRAM [PATTERN]: runs with the sanitizer; a report makes the status 66
race() {
    TSAN_OPTIONS="suppressions=tests/tsan.supp halt_on_error=0 exitcode=66 ignore_noninstrumented_modules=1 \
second_deadlock_stack=1" CMOCKA_MESSAGE_OUTPUT=TAP "$@" >"$tsan/run.log" 2>&1
}
race "$tsan/tests/test_inertial"
outcome "the ring between two threads has no race" $? "$tsan/run.log"
race "$tsan/tests/test_api_step" 'samples_are_pushed*'
outcome "pushing samples while stepping has no race" $? "$tsan/run.log"
race "$tsan/tests/test_api_device" 'contexts_step_on_threads*'
outcome "two contexts on two threads have no race" $? "$tsan/run.log"
