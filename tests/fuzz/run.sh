#!/bin/sh
# Builds the fuzzers with clang and runs each for some seconds: tests/fuzz/run.sh BUILD SECONDS [NAME...]. Prints TAP. A crash,
# leak or hang (an input of more than 5 s) leaves its input in BUILD/fuzz.
set -u
build=$1
seconds=$2
shift 2
cd "$(dirname "$0")/../.." || exit 1
work=$build/fuzz
mkdir -p "$work"
flags="-std=c11 -D_GNU_SOURCE -O1 -g -Wall -Wextra -Ilib -Idrivers -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all"
[ $# -gt 0 ] || set -- $(for f in tests/fuzz/fuzz_*.c; do basename "$f" .c; done)
echo "1..$#"
printf 'int LLVMFuzzerTestOneInput(const unsigned char *d, unsigned long n);\nint LLVMFuzzerTestOneInput(const unsigned char *d, unsigned long n) { (void)d; return (int)(n & 0); }\n' >"$work/probe.c"
number=0
clang=
for candidate in ${FUZZ_CC:-clang clang-15 clang-16 clang-19}; do
    # shellcheck disable=SC2086
    [ -z "$clang" ] && $candidate $flags -o "$work/probe" "$work/probe.c" >"$work/probe.log" 2>&1 && clang=$candidate
done
if [ -z "$clang" ]; then
    for name in "$@"; do
        number=$((number + 1))
        echo "ok $number - $name # SKIP clang with libFuzzer isn't here (Debian: clang libclang-rt-dev)"
    done
    exit 0
fi

sh tests/fuzz/seeds.sh "$work/seeds"

# What each fuzzer is about, beside itself.
parts() {
    case $1 in
    fuzz_hid_descriptor) echo imu/hid_descriptor imu/hid_sensor imu/imu_reading ;;
    fuzz_hid_feature | fuzz_hid_report) echo imu/hid_models imu/hid_playstation imu/imu_reading ;;
    fuzz_mtdata2) echo imu/mtdata2 imu/imu_reading ;;
    fuzz_udp_lines) echo imu/udp_lines address imu/iio_channels ;;
    fuzz_oni) echo camera/openni2_oni ;;
    esac
}

failed=0
for name in "$@"; do
    number=$((number + 1))
    sources=$(for p in $(parts "$name"); do echo "drivers/$p.c"; done)
    log=$work/$name.log
    mkdir -p "$work/corpus/$name" "$work/seeds/$name"
    # shellcheck disable=SC2086
    if $clang $flags -o "$work/$name" "tests/fuzz/$name.c" $sources -lm >"$log" 2>&1 &&
        "$work/$name" -max_total_time="$seconds" -timeout=5 -rss_limit_mb=1024 -max_len=8192 -print_final_stats=1 -verbosity=1 \
            -artifact_prefix="$work/$name-" "$work/corpus/$name" "$work/seeds/$name" >>"$log" 2>&1; then
        echo "ok $number - $name, $seconds s, $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") inputs"
    else
        echo "not ok $number - $name"
        grep -vE '^#[0-9]+|^[[:space:]]*$' "$log" | tail -n 30 | sed 's/^/#   /'
        failed=$((failed + 1))
    fi
done
[ $failed -eq 0 ]
