#!/bin/sh
# Builds what uses two threads with the thread sanitizer and runs it: tests/e2e/thread_sanitizer.sh BUILD. Prints TAP.
set -u
build=$1
tsan=$build/tsan
cd "$(dirname "$0")/../.." || exit 1
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

tests=14
echo "1..$tests"
printf 'int main(void) { return 0; }\n' >"$tsan/probe.c"
if ! ${CC:-cc} -fsanitize=thread -o "$tsan/probe" "$tsan/probe.c" 2>"$tsan/probe.log" || ! "$tsan/probe" 2>>"$tsan/probe.log"; then
    for i in $(seq 1 $tests); do echo "ok $i - thread sanitizer # SKIP the compiler's thread sanitizer doesn't work here"; done
    exit 0
fi

make BUILD="$tsan" SANITIZE=thread OPTIMISE='-O1 -g' "$tsan/tests/test_inertial" "$tsan/tests/test_api_step" \
    "$tsan/tests/test_api_device" "$tsan/tests/test_source" "$tsan/tests/test_imu_stream" \
    "$tsan/tests/test_udp_source" "$tsan/tests/test_usb_source" "$tsan/tests/test_iio_source" "$tsan/tests/test_sink" "$tsan/fathom" >"$tsan/make.log" 2>&1
status=$?
outcome "builds with the thread sanitizer" $status "$tsan/make.log"
if [ $status -ne 0 ]; then
    for i in $(seq 2 $tests); do echo "not ok $i - not built"; done
    exit 1
fi

# race PROGRAM [PATTERN]: runs with the sanitizer; a report makes the status 66
race() {
    TSAN_OPTIONS="suppressions=tests/support/tsan.supp halt_on_error=0 exitcode=66 ignore_noninstrumented_modules=1 \
second_deadlock_stack=1" CMOCKA_MESSAGE_OUTPUT=TAP "$@" >"$tsan/run.log" 2>&1
}
race "$tsan/tests/test_inertial"
outcome "the ring between two threads has no race" $? "$tsan/run.log"
race "$tsan/tests/test_api_step" 'samples_are_pushed*'
outcome "pushing samples while stepping has no race" $? "$tsan/run.log"
race "$tsan/tests/test_api_device" 'contexts_step_on_threads*'
outcome "two contexts on two threads have no race" $? "$tsan/run.log"
race "$tsan/tests/test_source"
outcome "queues and recording folders as sources have no race" $? "$tsan/run.log"
race "$tsan/tests/test_imu_stream"
outcome "inertial streams have no race" $? "$tsan/run.log"
race "$tsan/tests/test_udp_source"
outcome "a phone by UDP has no race" $? "$tsan/run.log"
race "$tsan/tests/test_usb_source"
outcome "USB transfers have no race" $? "$tsan/run.log"
race "$tsan/tests/test_iio_source"
outcome "IIO buffers have no race" $? "$tsan/run.log"
race "$tsan/tests/test_sink"
outcome "frames and samples on two threads of a sink have no race" $? "$tsan/run.log"
if [ -f "$build/tests/test_openni2" ]; then
    make BUILD="$tsan" SANITIZE=thread OPTIMISE='-O1 -g' "$tsan/tests/test_openni2" >"$tsan/make.log" 2>&1 &&
        race "$tsan/tests/test_openni2"
    outcome "cameras of OpenNI2 have no race" $? "$tsan/run.log"
else
    outcome "cameras of OpenNI2 have no race # SKIP built without OpenNI2" 0
fi
"$build/fathom" simulate desk "$tsan/rig" --frames 20 --size 160x120 >"$tsan/run.log" 2>&1
outcome "a rig to scan" $? "$tsan/run.log"
race "$tsan/fathom" scan --depth "$tsan/rig" --speed 0.5 --progress --json
outcome "a scan has no race" $? "$tsan/run.log"
rm -rf "$tsan/copy"
race "$tsan/fathom" log "$tsan/copy" --depth "$tsan/rig" --speed 0.5 --progress --json
outcome "a recording has no race" $? "$tsan/run.log"
