#!/bin/sh
# What fathom simulate --sensor writes: sizes, rates, confidence, the same for any number of threads; and that replay goes
# through each sensor's room. Usage: sh tests/e2e/sensors.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
own_caches

# simulate FOLDER OPTIONS...: a room, silently.
simulate() {
    folder=$1
    shift
    run "$fathom" simulate room "$folder" "$@"
    [ "$status" -eq 0 ]
}

# first_size FOLDER: WxH of the first depth image.
first_size() {
    od -An -tu1 -j16 -N8 "$1/$(sed -n '/^[^#]/{s/.* //p;q;}' "$1/depth.txt")" | awk '{ print $3 * 256 + $4 "x" $7 * 256 + $8 }'
}

# stamp FOLDER N: of frame N, from 1.
stamp() { grep -v '^#' "$1/depth.txt" | sed -n "$2{s/ .*//p;}"; }

# same FOLDER FOLDER: but for the first lines, which hold the commands.
same() {
    for part in depth confidence; do
        [ ! -d "$1/$part" ] && [ ! -d "$2/$part" ] || diff -r "$1/$part" "$2/$part" >out 2>err || return 1
    done
    cmp "$1/rig.txt" "$2/rig.txt" >out 2>err && cmp "$1/calibration.txt" "$2/calibration.txt" >out 2>err
}

simulate plain --frames 2 && simulate kinect --frames 2 --sensor kinect && same plain kinect && [ "$(first_size plain)" = 640x480 ] &&
    [ ! -e plain/confidence.txt ] && [ "$(stamp plain 2)" = 0.033333000 ]
check "without --sensor it is a Kinect: 640x480, 30 a second"
rm -rf plain kinect

simulate lidar --frames 3 --sensor lidar --threads 1 && [ "$(first_size lidar)" = 256x192 ] && [ "$(stamp lidar 2)" = 0.016667000 ] &&
    [ "$(grep -c '^[^#]' lidar/confidence.txt)" -eq 3 ] && grep -q '^confidence_min 2$' lidar/rig.txt &&
    [ "$(cut -d' ' -f1 lidar/calibration.txt)" = 180.27 ]
check "lidar: 256x192, 60 a second, with confidence and the least that counts"

simulate tof --frames 3 --sensor tof --threads 1 && [ "$(first_size tof)" = 512x424 ] && [ "$(stamp tof 2)" = 0.033333000 ] &&
    [ ! -e tof/confidence.txt ]
check "tof: 512x424, 30 a second, without confidence"

for sensor in lidar tof; do
    simulate again --frames 3 --sensor $sensor --threads 3 && same $sensor again
    check "$sensor: the same with three threads"
    simulate again --frames 3 --sensor $sensor --seed 2 && ! same $sensor again
    check "$sensor: another seed gives other frames"
    rm -rf again
done

simulate blurred --frames 3 --sensor lidar --blur --speed 3 --still 0 && simulate still --frames 3 --sensor lidar --speed 3 --still 0 &&
    ! same blurred still && [ "$(grep -c '^[^#]' blurred/confidence.txt)" -eq 3 ]
check "lidar: --blur has its effect"
rm -rf blurred still

simulate clean --frames 2 --sensor lidar --clean && [ ! -e clean/confidence.txt ] && ! grep -q confidence_min clean/rig.txt &&
    [ "$(first_size clean)" = 256x192 ]
check "lidar: --clean has its size and no confidence"

simulate small --frames 5 --sensor tof --size 128x106 --rate 10 && [ "$(first_size small)" = 128x106 ] && [ "$(stamp small 2)" = 0.100000000 ]
check "--size and --rate"

simulate moved --frames 4 --sensor lidar --motion lidar --force && [ "$(lines moved/groundtruth.txt)" -gt 3 ] && grep -q '^confidence_min 2$' moved/rig.txt
check "lidar: along another recording's path"

run "$fathom" simulate room never --sensor sonar
[ "$status" -eq 2 ] && one_error 'none of kinect, lidar, tof' && [ ! -e never ]
check "an unknown sensor is refused"
rm -rf lidar tof clean small moved

# within BOUND: the last replay's error, metres, and every frame tracked.
within() { [ "$(figure tracked)" = "$(figure frames)" ] && figure ate_rmse_m | awk -v most="$1" '{ good = $1 ~ /^[0-9]/ && $1 + 0 <= most } END { exit !good }'; }

for sensor in lidar tof; do
    simulate room --sensor $sensor --rate 10 --frames 100 && run "$fathom" replay room && [ "$status" -eq 0 ] && within 0.04
    check "$sensor: replay tracks every frame of its room, error at most 40 mm"
    rm -rf room
done
[ $failed -eq 0 ]
