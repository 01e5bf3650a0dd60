#!/bin/sh
# An IMU that isn't what the settings say: a simulated rig whose imu.txt is rewritten with each mistake. The warning names
# it, the scan goes on, and its trajectory is as good as without the mistake to within a centimetre.
# Usage: sh tests/e2e/plausibility.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
face=$data/face
lanes=
trap 'trap - INT TERM; [ -z "$lanes" ] || kill $lanes 2>/dev/null; exit 130' INT TERM
frames=130

# broken NAME RECORDING AWK OPTIONS...: the recording with each sample ($1 stamp, $2-$4 rad/s, $5-$7 m/s^2) changed, replayed into
# NAME.out and NAME.err.
broken() {
    mkdir "$1"
    for part in depth depth.txt calibration.txt rig.txt groundtruth.txt; do ln -s "../$2/$part" "$1/$part"; done
    awk -v CONVFMT=%.9g -v OFMT=%.9g "
        function limit(v, most) { return v > most ? most : v < -most ? -most : v }
        /^#/ { print; next } { $3; print }" "$2/imu.txt" >"$1/imu.txt"
    name=$1
    shift 3
    "$fathom" replay "$name" --threads 1 --voxel 0.02 "$@" >"$name.out" 2>"$name.err"
}

# goes_on NAME: nearly all frames were tracked, and truly.
goes_on() {
    tail -n 1 "$1.out" | awk -v frames=$frames '
        { for (i = 1; i <= NF; i++) { split($i, field, "="); value[field[1]] = field[2] } }
        END { exit !(value["frames"] == frames && value["tracked"] >= frames - 3 && value["lost"] == 0 &&
                     value["ate_rmse_m"] ~ /^[0-9]/ && value["ate_rmse_m"] <= 0.01) }'
}

# says NAME WORDS...: one warning, with all the words.
says() {
    of=$1
    shift
    [ "$(grep -c '^fathom: warning: ' "$of.err")" -eq 1 ] || return 1
    for words; do grep '^fathom: warning: ' "$of.err" | grep -q -F -e "$words" || return 1; done
}

# case TEXT NAME WORDS...
named() {
    text=$1
    name=$2
    shift 2
    says "$name" "$@" && goes_on "$name"
    check "$text" "$name.err" "$name.out"
}

"$fathom" simulate room rig --seed 3 --size 160x120 --frames $frames >out 2>err &&
    "$fathom" simulate room fast --seed 3 --size 160x120 --frames $frames --turn 1.5 >>out 2>>err &&
    "$fathom" simulate room long --seed 3 --size 160x120 --frames $((2 * frames)) >>out 2>>err
check "the rigs are simulated"
"$fathom" replay rig --voxel 0.02 >good.out 2>good.err # builds the kernels, once
(
    broken degrees rig 'for (i = 2; i <= 4; i++) $i *= 57.29578'
    broken g rig 'for (i = 5; i <= 7; i++) $i /= 9.80665'
    broken swapped rig 'v = $2; $2 = $3; $3 = v; v = $5; $5 = $6; $6 = v'
    broken mirrored rig '$2 = -$2'
    broken clipped fast 'for (i = 2; i <= 4; i++) $i = limit($i, 0.4)'
) &
lanes=$!
(
    broken opposite rig 'for (i = 5; i <= 7; i++) $i = -$i'
    broken stuck rig 'if ($1 < 2) { x = $2; y = $3; z = $4 } else { $2 = x; $3 = y; $4 = z }'
    broken half long '$1 *= 0.5' --stride 2 # its samples end amid the recording
    broken double rig '$1 *= 2'
    if [ -r "$face/depth.txt" ]; then "$fathom" replay "$face" --threads 1 >face.out 2>face.err; fi
) &
lanes="$lanes $!"
wait
lanes=

[ "$(grep -c '^fathom: warning: ' good.err)" -eq 0 ] && goes_on good
check "an IMU that is right: no warning" good.err good.out
named "gyroscope in degrees/s" degrees "degrees/s, not rad/s" "goes on without the IMU"
named "accelerometer in g" g "in g" "IMU's rotation only"
named "x and y swapped" swapped "gyroscope has its axes wrong: x and y swapped" "goes on without the IMU"
named "gyroscope's x mirrored" mirrored "gyroscope has its axes wrong: x mirrored" "goes on without the IMU"
named "accelerometer with the opposite sign" opposite "accelerometer has the opposite sign" "IMU's rotation only"
named "gyroscope stuck from 2 s on" stuck "gyroscope is stuck" "goes on without the IMU"
named "gyroscope cut off at 23 degrees/s" clipped "gyroscope is cut off at 0.4 rad/s" "goes on with it"
named "stamps at half the pace" half "stamps run 0.5 times as fast" "goes on without the IMU"
named "stamps at twice the pace" double "stamps run 2 times as fast" "goes on without the IMU"
if [ -r "$face/depth.txt" ]; then
    ! grep -q -e gyroscope -e accelerometer -e "IMU" face.err && grep -q "tracked=90 " face.out
    check "a real phone: no warning of its IMU, all frames tracked" face.err face.out
else
    skip "a real phone" "../shared/data/face isn't there"
fi
echo "1..$number"
[ $failed -eq 0 ]
