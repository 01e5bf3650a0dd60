#!/bin/sh
# How true the camera's way is: on a real recording at several frame rates, with one iteration a frame, with the lens
# covered, and on a simulated room without noise (its mesh is measured by tests/unit/map/test_surface.c).
# Usage: sh tests/e2e/accuracy.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
# Two replays run at a time with one thread each: the outcome doesn't depend on the number of threads
# (tests/e2e/determinism.sh), the time does little.
set -u
. "$(dirname "$0")/../support/command.sh"
kitchen=$data/kitchen
walk=$data/stray_walk
lanes=
trap 'trap - INT TERM; [ -z "$lanes" ] || kill $lanes 2>/dev/null; exit 130' INT TERM

# result TEXT FILE: reports on the status of the command before it; FILE.out holds the summary line.
result() {
    status=$?
    number=$((number + 1))
    summary=$(tail -n 1 "$2.out" 2>/dev/null)
    if [ $status -eq 0 ]; then
        echo "ok $number - $1 ($summary)"
    else
        echo "not ok $number - $1 (${summary:-no summary})"
        sed 's/^/#   /' "$2.err" 2>/dev/null
        failed=$((failed + 1))
    fi
}

# replay FOLDER NAME OPTIONS...: leaves NAME.out, NAME.err and NAME.csv; no NAME.out when it failed.
replay() {
    folder=$1
    name=$2
    shift 2
    "$fathom" replay "$folder" --threads 1 --stats "$name.csv" "$@" >"$name.part" 2>"$name.err" &&
        mv "$name.part" "$name.out"
}

# figure_of NAME KEY: KEY's value in NAME's summary line.
figure_of() {
    awk -v key="$2" '{ line = $0 }
        END { n = split(line, field, " "); for (i = 1; i <= n; i++) if (index(field[i], key "=") == 1) print substr(field[i], length(key) + 2) }' "$1.out" 2>/dev/null
}

# within NAME BOUND: the trajectory's error, metres. False for nan and where there is none.
within() { figure_of "$1" ate_rmse_m | awk -v most="$2" '{ good = $1 ~ /^[0-9]/ && $1 + 0 <= most } END { exit !good }'; }

# complete NAME FRAMES: all frames were taken and all were tracked.
complete() { [ "$(figure_of "$1" frames)" = "$2" ] && [ "$(figure_of "$1" tracked)" = "$2" ]; }

# Exactly the frames A..B-1 of NAME are reckoned.
reckoned_only() {
    awk -F, -v a="$2" -v b="$3" '
        NR > 1 { frame = NR - 2; blank = frame >= a && frame < b
                 if (blank != ($2 == "reckoned") || $2 == "lost") { print "frame " frame " is " $2; bad = 1 } }
        END { exit bad || NR < b + 2 }' "$1.csv" >>"$1.err" 2>&1
}

has_kitchen= has_walk=
[ ! -r "$walk/odometry.csv" ] || has_walk=yes
[ -r "$kitchen/depth.txt" ] && has_kitchen=yes

# Two lanes of about equal length. The kernels are built first, and once.
"$fathom" info --plan >plan.out 2>plan.err || true
(
    if [ $has_kitchen ]; then
        replay "$kitchen" stride1 --stride 1
        replay "$kitchen" outage --outage 200:210
        replay "$kitchen" stride4 --stride 4
        replay "$kitchen" stride16 --stride 16
        replay "$kitchen" stride32 --stride 32
        replay "$kitchen" long --outage 200:270
    fi
) &
lanes=$!
(
    "$fathom" simulate room room --clean --threads 1 >room-made 2>room.err && replay room room
    rm -rf room
    "$fathom" simulate room small --size 80x60 --frames 150 --still 0 --threads 1 >small-made 2>small.err && replay small small
    rm -rf small
    if [ $has_kitchen ]; then
        replay "$kitchen" single --stride 1 --iterations 0,0,1
        replay "$kitchen" stride2 --stride 2
        replay "$kitchen" stride8 --stride 8
        replay "$kitchen" stride12 --stride 12
        replay "$kitchen" alone --stride 16 --imu none
        replay "$kitchen" seed --stride 8 --prior seed
    fi
    [ ! $has_walk ] || { replay "$walk" walk4 --stride 4 && replay "$walk" walk8 --stride 8; }
    "$fathom" simulate wall wall --threads 1 >wall-made 2>wall.err && replay wall wall && replay wall slides --imu none
    rm -rf wall
) &
lanes="$lanes $!"
wait
lanes=

if [ $has_kitchen ]; then
    frames=$(grep -c '^[^#]' "$kitchen/depth.txt")
    for stride in 1 2 4 8 12; do
        complete stride$stride $(((frames + stride - 1) / stride)) && within stride$stride 0.025
        result "kitchen, stride $stride: all frames tracked, error at most 25 mm" stride$stride
    done
    complete stride16 $(((frames + 15) / 16)) && within stride16 0.025
    result "kitchen, stride 16: all frames tracked, error at most 25 mm" stride16
    complete stride32 $(((frames + 31) / 32)) && within stride32 0.04
    result "kitchen, stride 32: all frames tracked, error at most 40 mm" stride32
    complete alone $(((frames + 15) / 16)) && within alone 0.03
    result "kitchen, stride 16 without the IMU: wrong alignments are refused and the right ones found" alone
    complete seed $(((frames + 7) / 8)) && within seed 0.025
    result "kitchen, stride 8, the paper's way of using inertia: all frames tracked, error at most 25 mm" seed
    reckoned_only long 200 270 && within long 0.035
    result "kitchen, lens covered during frames 200 to 269: just these are reckoned, error at most 35 mm" long
    complete single "$frames" && within single 0.025
    result "kitchen, a single iteration a frame: all frames tracked, error at most 25 mm" single
    reckoned_only outage 200 210 && [ "$(figure_of outage reckoned)" = 10 ] && [ "$(figure_of outage lost)" = 0 ] && within outage 0.03
    result "kitchen, lens covered during frames 200 to 209: just these are reckoned, error at most 30 mm" outage
else
    absent="../shared/data/kitchen isn't there"
    for stride in 1 2 4 8 12; do skip "kitchen, stride $stride" "$absent"; done
    for stride in 16 32; do skip "kitchen, stride $stride" "$absent"; done
    skip "kitchen, stride 16 without the IMU" "$absent"
    skip "kitchen, stride 8, the paper's way of using inertia" "$absent"
    skip "kitchen, lens covered during frames 200 to 269" "$absent"
    skip "kitchen, a single iteration a frame" "$absent"
    skip "kitchen, lens covered during frames 200 to 209" "$absent"
fi
if [ $has_walk ]; then
    for stride in 4 8; do
        [ "$(figure_of walk$stride lost)" = 0 ] && within walk$stride 0.12 &&
            [ $(($(figure_of walk$stride reckoned) * 100)) -le $(($(figure_of walk$stride frames) * 18)) ]
        result "a phone's LiDAR past glass, stride $stride: never lost, error at most 120 mm, at most 18 % reckoned" walk$stride
    done
else
    for stride in 4 8; do skip "a phone's LiDAR past glass, stride $stride" "../shared/data/stray_walk isn't there"; done
fi
complete room 300 && within room 0.002
result "simulated room without noise: all frames tracked, error at most 2 mm" room
complete small 150 && within small 0.015
result "simulated room in 80x60 pixels: all frames tracked, error at most 15 mm" small
[ "$(figure_of wall lost)" = 0 ] && within wall 0.015
result "simulated bare wall: error at most 15 mm, never lost" wall
[ "$(figure_of slides tracked)" -lt 200 ]
result "the same without the IMU: it is said that it isn't tracked" slides

[ $failed -eq 0 ]
