#!/bin/sh
# Writes a few good inputs for each fuzzer, to start from: tests/fuzz/seeds.sh FOLDER.
set -eu
out=$1
# seed FUZZER NAME HEX...: bytes in hexadecimal
seed() {
    mkdir -p "$out/$1"
    file=$out/$1/$2
    shift 2
    # shellcheck disable=SC2059
    printf "$(printf '%s' "$*" | tr -d ' ' | sed 's/../\\x&/g')" >"$file"
}
zeros() { printf '%0*d' $((2 * $1)) 0; }

axes="16 01 80 26 FF 7F 75 10 95 01"
seed fuzz_hid_descriptor sensors 07 05 20 09 01 A1 01 85 01 09 73 A1 00 $axes 55 0E 0A 53 04 81 02 0A 54 04 81 02 0A 55 04 81 02 C0 \
    85 02 09 76 A1 00 $axes 55 0F 0A 57 04 81 02 0A 58 04 81 02 0A 59 04 81 02 0A 0E 03 15 00 25 7F 75 08 B1 02 C0 C0 02 01 00 02 00 03 00
seed fuzz_hid_descriptor pad 04 05 01 09 05 A1 01 09 30 09 31 15 00 26 FF 00 75 08 95 02 81 02 05 09 19 01 29 08 25 01 75 01 95 08 81 02 C0 01 02 03
sony="0000 0000 0100 A622 5CDD A622 61DD 9022 6BDD 1C02 1C02 FF1F FEDF 971F B2DF F61F EDDF 0000 00000000"
seed fuzz_hid_feature dualsense 05 05 $sony
seed fuzz_hid_feature dualshock 00 02 $sony
seed fuzz_hid_feature bluetooth 06 05 $sony
seed fuzz_hid_report dualsense 05 41 01 "$(zeros 64)" 45 01 "$(zeros 68)"
seed fuzz_hid_report bluetooth 06 4F 31 "$(zeros 78)" 4F 31 "$(zeros 78)"
seed fuzz_hid_report switch 09 31 30 "$(zeros 48)"
# packet counter, sample time, rate of turn, acceleration
seed fuzz_mtdata2 whole 10 FA FF 36 2B 10 20 02 00 01 10 60 04 00 00 03 E8 80 20 0C 3E 00 00 00 BF C0 00 00 40 10 00 00 \
    40 20 0C BF 00 00 00 41 1D 00 00 40 44 00 00 66
seed fuzz_mtdata2 items 10 20 02 00 01 10 60 04 00 00 03 E8 80 30 10 3F 80 00 00 00 00 00 00 00 00 00 00 00 00 00 00
mkdir -p "$out/fuzz_udp_lines"
printf '890.715, 3, -0.07, 9.19, 2.47, 4, 0.01, -0.03, 0.00, 5, 12.1, -3.0, 40.2' >"$out/fuzz_udp_lines/csv"
printf '{"t": 890.715, "gyro": [0.01, -0.03, 0.00], "accel": [-0.07, 9.19, 2.47], "n": 17, "x": {"a": [true, null, "\\\\"]}}' >"$out/fuzz_udp_lines/json"
printf '127.0.0.1:5555?format=json&time=ms' >"$out/fuzz_udp_lines/uri"
printf 'be:s12/16>>4' >"$out/fuzz_udp_lines/format"
printf '0, 1, 0; -1, 0, 0; 0, 0, 1' >"$out/fuzz_udp_lines/matrix"
