#!/bin/sh
# fathom calibrate and replay --refine-rig: the rig comes out of simulated recordings and of a real one, rig.txt keeps its other lines, and
# recordings that can't tell are refused with the reason.
# Usage: sh tests/e2e/calibrate.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
face=$data/face
motion=$data/motion_combined

calibrate() { run "$fathom" calibrate "$@" --threads 1; }

# near FILE X Y Z DEGREES OFFSET SECONDS: the rig's rotation and clock offset.
near() {
    awk -v x="$2" -v y="$3" -v z="$4" -v most="$5" -v offset="$6" -v seconds="$7" '
        function quaternion(q, x, y, z,   a, s) {
            a = sqrt(x * x + y * y + z * z) * atan2(0, -1) / 180
            s = a > 0 ? sin(a / 2) / (a * 180 / atan2(0, -1)) : 0
            q[0] = cos(a / 2); q[1] = s * x; q[2] = s * y; q[3] = s * z
        }
        $1 == "imu_to_camera_rotation" { quaternion(p, $2, $3, $4); quaternion(q, x, y, z); seen++
            c = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
            if (c < 0) c = -c
            if (c > 1) c = 1
            angle = 2 * atan2(sqrt(1 - c * c), c) * 180 / atan2(0, -1) }
        $1 == "imu_clock_offset" { off = $2 - offset; if (off < 0) off = -off; seen++ }
        END { print "angle " angle ", offset off by " off; exit !(seen == 2 && angle <= most && off <= seconds) }' "$1" >>err
}

# rig NAME ROTATION OFFSET OPTIONS...: simulates and calibrates; the result goes to NAME.rig.
rig() {
    name=$1 rotation=$2 offset=$3
    shift 3
    "$fathom" simulate room "$name" --size 160x120 --frames 180 --threads 1 --imu-rotation="$rotation" \
        --imu-clock-offset="$offset" "$@" >made 2>err &&
        calibrate "$name" --output "$name.rig" && [ $status -eq 0 ]
}

rig a 180,0,0 0.1 --still 0 && near a.rig 180 0 0 0.3 0.1 0.002
check "half a turn, 0.1 s, moving early"
rig b -60,100,-20 -0.07 --seed 2 && near b.rig -60 100 -20 0.3 -0.07 0.002
check "a mounting at any angle, -0.07 s"

"$fathom" simulate room still --size 160x120 --frames 60 --still 10 --threads 1 >made 2>err
cp still/rig.txt before
calibrate still
[ $status -eq 1 ] && one_error 'hardly turns' && cmp -s before still/rig.txt
check "no turning: refused, rig.txt untouched"

"$fathom" simulate room tremor --size 160x120 --frames 80 --turn 0 --imu-grade phone --threads 1 >made 2>err
calibrate tremor --output tremor.rig
[ $status -eq 1 ] && one_error 'hardly turns' && [ ! -e tremor.rig ]
check "nothing but tremor: refused"

"$fathom" simulate wall wall --size 160x120 --frames 120 --threads 1 >made 2>err
printf '# mine\ndepth_scale 5000 # by the maker\nimu_clock_offset 5\ngravity 9.81\nimu_clock_offset 6' >wall/rig.txt
calibrate wall
[ $status -eq 0 ] && near wall/rig.txt 0.8 -1.2 90 1 0 0.002 && grep -q '^# mine$' wall/rig.txt &&
    grep -q '^depth_scale 5000 # by the maker$' wall/rig.txt && grep -q '^gravity 9.81$' wall/rig.txt &&
    [ "$(grep -c imu_clock_offset wall/rig.txt)" -eq 1 ] && [ ! -e wall/rig.txt.part ] && grep -q 'imu_clock_offset .*+-' out
check "past a bare wall; rig.txt: wrong values are no start, other lines stay, one line a key"

"$fathom" simulate room short --size 160x120 --frames 40 --still 0 --turn 0.7 --imu-grade phone --imu-rotation 5,3,90 \
    --threads 1 >made 2>err
calibrate short --output short.rig
[ $status -eq 0 ] && grep -q 'taken as square to within 2 degrees; the data alone says .*+-' out &&
    grep -q '^fathom: warning: .*the mounting open by .*would help: nodding (about x), rolling' err
check "a short pan: what the square mounting did is said, and a warning says what would help"

calibrate still --imu nowhere
[ $status -eq 1 ] && one_error 'nowhere'
check "an IMU file that isn't there"
rm still/imu.txt
calibrate still
[ $status -eq 1 ] && one_error 'no IMU samples'
check "no imu.txt"
calibrate still --offset-range x
[ $status -eq 2 ] && one_error 'offset-range'
check "a wrong option"
calibrate
[ $status -eq 2 ] && one_error 'unknown option\|no folder'
check "no folder"

if [ -r "$motion/groundtruth.txt" ]; then
    "$fathom" simulate room moved --motion "$motion" --size 160x120 --frames 90 --threads 1 >made 2>err
    truth=$(awk '$1 == "imu_to_camera_rotation" { print $2, $3, $4 } $1 == "imu_clock_offset" { o = $2 } END { print o }' \
        "$motion/rig.txt")
    calibrate moved --output moved.rig
    # shellcheck disable=SC2086
    set -- $truth
    [ $status -eq 0 ] && near moved.rig "$1" "$2" "$3" 0.5 "$4" 0.001
    check "a hand's motion and a real IMU: within 0.5 degrees and 1 ms of its rig.txt"
else
    skip "a hand's motion and a real IMU" "../shared/data/motion_combined isn't there"
fi
# ate FILE: of a replay's summary.
ate() { sed -n 's/.*ate_rmse_m=\([^ ]*\).*/\1/p' "$1"; }

# refined: what a replay with --refine-rig said at its end, as a rig.txt has it.
refined() {
    sed -n 's/.*refined: \(imu_to_camera_rotation [^(]*\) (.*\(imu_clock_offset [^ ]*\) .*/\1\n\2/p' err >refined.rig
}

# wrong NAME ROTATION OFFSET: a recording whose true mounting is 0,0,0 and whose true offset is 0.02 s.
wrong() {
    sed -i "s/^imu_to_camera_rotation.*/imu_to_camera_rotation $2/; s/^imu_clock_offset.*/imu_clock_offset $3/" \
        "$1/rig.txt" &&
        "$fathom" replay "$1" --threads 1 --refine-rig off >off 2>err && ! grep -q refined err &&
        "$fathom" replay "$1" --threads 1 --refine-rig on >on 2>err && refined && near refined.rig 0 0 0 0.3 0.02 0.002
}

"$fathom" simulate room e --size 160x120 --frames 240 --still 0 --turn 2.5 --threads 1 --imu-rotation=0,0,0 \
    --imu-clock-offset=0.02 >made 2>err
wrong e '2 -2 2' 0.005 && awk -v off="$(ate off)" -v on="$(ate on)" 'BEGIN { exit !(on < 0.85 * off) }'
check "replay --refine-rig: off by 2 degrees about each axis and -15 ms: found, and the path is better for it" err off on
wrong e '-2 2 1' 0.035 && awk -v off="$(ate off)" -v on="$(ate on)" 'BEGIN { exit !(on < off) }'
check "the other way, +15 ms" err off on

if [ -r "$face/depth.txt" ]; then
    calibrate "$face" --output face.rig
    [ $status -eq 0 ] && near face.rig 0 0 90 2 0.055 0.015 && grep -q '^depth_scale 10000' face.rig
    check "a real phone: within 2 degrees of (0 0 90), 0.040 to 0.070 s"
else
    skip "a real phone" "../shared/data/face isn't there"
fi

[ $failed -eq 0 ]
