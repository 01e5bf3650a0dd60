#!/bin/sh
# The table of settings as the command shows and takes it. Usage: sh tests/e2e/settings.sh BUILD_DIR. Prints TAP; exits 1 when a
# case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"

build=${1:?usage: sh tests/e2e/settings.sh BUILD_DIR}
fathom=$(cd "$build" && pwd)/fathom
tests=$(cd "$(dirname "$0")/.." && pwd)
page=$tests/../docs/SETTINGS.md
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-settings-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
cd "$work" || exit 1

# wrong PATTERN COMMAND...: refused with status 2 and one line on stderr that has the words.
wrong() {
    words=$1
    shift
    "$fathom" "$@" >out 2>err
    [ $? -eq 2 ] && [ "$(wc -l <err)" -eq 1 ] && grep -qF -e "$words" err
}

"$fathom" info --settings >list 2>err && head -n 1 list | grep -q '^name *unit *range *default *meaning$' &&
    grep -q '^voxel_m  *m  *0.001..1  *0.01  *Edge of a voxel$' list &&
    grep -q '^against  *-  *model|previous  *model  ' list && grep -q '^max_blocks  *-  *0,64..16777216  *0  ' list
check "info --settings lists name, unit, range, default and meaning" list err

awk 'NR == 1 { at = index($0, "meaning") } substr($0, at - 2, 2) != "  " || substr($0, at, 1) == " " { exit 1 }' list
check "columns are aligned" list

"$fathom" info --settings --markdown >page 2>err && cmp page "$page" >>err
check "docs/SETTINGS.md is what the table says (make settings writes it)" err

python3 "$tests/support/settings_header.py" "$tests/../lib/fathom.h" <list >out 2>err
check "ranges and defaults in fathom.h's comments are the table's" out err

for name in $(awk 'NR > 1 { print $1 "=" $4 }' list); do set -- "$@" --set "$name"; done
shift
"$fathom" info "$@" >out 2>err
check "every default that is listed can be set"

"$fathom" info --plan --size 80x60 --set voxel_m=0.025 >out 2>err && grep -q 'voxel 0.025 m' out
check "--set reaches the library"
"$fathom" info --plan --size 80x60 --set voxel_m=0.025 --set voxel_m=0.03 --preset tiny >out 2>err && grep -q 'voxel 0.03 m' out
check "the last --set of a setting counts, also before --preset"
"$fathom" info --plan --set max_blocks=1000 --set=depth_camera.width=320 --set depth_camera.height=240 >out 2>err &&
    grep -q ' blocks=1000 ' out && grep -q 'depth 320x240' out
check "--set takes any setting"

wrong "did you mean voxel_m?" info --set voxle_m=0.02
check "a setting that is misspelt gets a suggestion"
wrong "did you mean max_iterations[0]?" info --set max_iterations=3
check "an array without its index gets a suggestion"
wrong "there is no setting 'qqqqqqqqqqqq'; fathom info --settings" info --set qqqqqqqqqqqq=0.02
check "a setting that is like none gets none"
wrong "voxel_m: '3' is outside 0.001..1 m" info --set voxel_m=3
check "a value out of range is refused with setting, value, range and unit"
wrong "voxel_m: '1cm' is not a number" info --set voxel_m=1cm
check "a value that is no number is refused"
wrong "max_pairs" info --set max_pairs=1
check "an unknown setting is named"
wrong "against: 'mode' is none of model|previous" info --set against=mode
check "a word that isn't one is refused with the words"
wrong "isn't NAME=VALUE" info --set voxel_m
check "--set without a value is refused"

"$fathom" simulate room room --frames 4 --size 80x60 >out 2>err
check "a recording"
for command in "replay room" "scan --depth folder:room" "kernels kernels" "calibrate room"; do
    # shellcheck disable=SC2086
    wrong "did you mean huber_m?" $command --set hubber_m=0.1
    check "$command takes --set"
done
"$fathom" replay room --size 80x60 --voxel 0.04 --memory 32 --stats plain.csv >out 2>err &&
    "$fathom" replay room --size 80x60 --voxel 0.04 --memory 32 --stats same.csv --set max_iterations[0]=10 >out 2>err &&
    "$fathom" replay room --size 80x60 --memory 32 --stats voxel.csv --set voxel_m=0.04 >out 2>err &&
    cut -d, -f1-9 plain.csv >plain && cut -d, -f1-9 same.csv | cmp - plain >>err && cut -d, -f1-9 voxel.csv | cmp - plain >>err
check "--set is what the option of the same setting is"
"$fathom" replay room --size 80x60 --voxel 0.04 --memory 32 --stats scale.csv --set depth_units_per_metre=2500 >out 2>err &&
    ! cmp -s scale.csv plain.csv && [ "$(tail -n 1 scale.csv | cut -d, -f5)" != "$(tail -n 1 plain.csv | cut -d, -f5)" ]
check "--set wins over what the recording says"

echo "1..$number"
[ "$failed" -eq 0 ]
