#!/bin/sh
# Live scans, end to end, with recordings in the place of devices; and what fathom says of devices.
# Usage: sh tests/e2e/scan.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
own_caches

# scan OPTIONS...: into out, err and $status.
scan() { run "$fathom" scan "$@"; }

"$fathom" simulate desk rig --frames 60 --size 160x120 --still 0.3 >out 2>err
check "a recording to scan"

"$fathom" replay rig --trajectory replay.txt --odometry replay-odometry.txt --mesh replay.ply >out 2>err
scan --depth rig --speed 0 --trajectory scan.txt --odometry scan-odometry.txt --mesh scan.ply
[ $status -eq 0 ] && cmp -s replay.txt scan.txt && cmp -s replay-odometry.txt scan-odometry.txt && cmp -s replay.ply scan.ply && [ "$(figure frames)" -eq 60 ] &&
    [ "$(figure frames_dropped)" -eq 0 ] && [ "$(figure samples_dropped)" -eq 0 ] && samples=$(figure samples) &&
    [ "$samples" -gt 300 ]
check "as fast as it goes: pose for pose and byte for byte what a replay gives"

scan --depth folder:rig --trajectory t.txt --mesh m.ply --stats s.csv
[ $status -eq 0 ] && [ $(($(figure frames) + $(figure frames_dropped))) -eq 60 ] && [ "$(figure lost)" -eq 0 ] &&
    [ "$(figure samples_dropped)" -eq 0 ] && [ "$(figure samples)" -eq "${samples:-0}" ] &&
    [ "$(lines t.txt)" -eq "$(figure frames)" ] && [ "$(lines s.csv)" -eq $(($(figure frames) + 1)) ] && whole_ply m.ply
check "in real time: every frame scanned or counted, every sample pushed"

# Frames of this size are stepped in a third of their period, so the median shows what scan itself adds.
awk -v x="$(figure latency_ms_median)" 'BEGIN { exit !(x < 2) }'
check "from arrival to step: under 2 ms"

scan --depth rig --imu none --speed 2
[ $status -eq 0 ] && [ "$(figure samples)" -eq 0 ] && [ ! -s err ]
check "--imu none"

cp -r rig deaf && rm deaf/imu.txt
scan --depth deaf --frames 5
[ $status -eq 0 ] && grep -q 'no inertial sensor' err && [ "$(figure frames)" -eq 5 ]
check "a folder without samples is scanned without; --frames ends it"

cp -r rig mortal && sed -n 1,150p rig/imu.txt >mortal/imu.txt
scan --depth rig --imu mortal
[ $status -eq 0 ] && grep -q 'IMU: at its end before the depth' err && [ "$(figure lost)" -eq 0 ] &&
    [ $(($(figure frames) + $(figure frames_dropped))) -eq 60 ]
check "the IMU dies: the scan goes on"

scan --depth rig --speed 0.05 --duration 1 --trajectory t.txt
[ $status -eq 0 ] && [ "$(figure frames)" -lt 10 ] && [ "$(lines t.txt)" -eq "$(figure frames)" ]
check "--duration ends it"

rm -f t.txt m.ply s.csv
"$fathom" scan --depth rig --speed 0.3 --trajectory t.txt --mesh m.ply --stats s.csv >out 2>err &
scanning=$!
tries=0
while [ "$(cat s.csv 2>/dev/null | wc -l)" -lt 6 ] && [ $tries -lt 200 ]; do sleep 0.05 && tries=$((tries + 1)); done
kill -TERM $scanning # a background job of a script ignores INT
wait $scanning
status=$?
[ $status -eq 130 ] && [ "$(lines t.txt)" -eq "$(figure frames)" ] && [ "$(figure frames)" -ge 5 ] &&
    [ "$(figure frames)" -lt 60 ] && whole_ply m.ply && [ -z "$(ls ./*.part 2>/dev/null)" ]
check "stopped: exit 130 and all files whole"

scan --depth rig --json --frames 8
[ $status -eq 0 ] && [ "$(lines out)" -eq 9 ] && python3 - <<'END'
import json
lines = [json.loads(line) for line in open("out")]
frames, summary = lines[:-1], lines[-1]["summary"]
assert summary["frames"] == len(frames) == 8
assert all(a["t"] < b["t"] for a, b in zip(frames, frames[1:]))
for f in frames:
    assert f["state"] in ("first", "tracked", "reckoned", "lost") and f["depth"] in ("running", "at end")
    assert abs(sum(q * q for q in f["quaternion"]) - 1) < 1e-5 and len(f["position"]) == 3
END
check "--json: a line a frame and one at the end"

mkdir mount && printf 'imu_to_camera_rotation 0 0 90\nimu_clock_offset 0.25\n' >mount/rig.txt
scan --depth rig --rig mount --speed 0 --trajectory mounted.txt
[ $status -eq 0 ] && ! cmp -s mounted.txt replay.txt && scan --depth rig --rig rig --speed 0 --trajectory mounted.txt &&
    cmp -s mounted.txt replay.txt
check "--rig: mounting and clock offset from another folder"

scan --depth rig --rig nowhere
[ $status -eq 1 ] && one_error 'nowhere: there is neither rig.txt nor calibration.txt'
check "--rig: a folder without them"

# ---- mistakes

scan --depth nowhere
[ $status -eq 2 ] && one_error 'nowhere: neither a folder'
check "a source that isn't there: exit 2"
scan --depth folder:nowhere
[ $status -eq 1 ] && one_error 'nowhere/depth.txt'
check "a folder that isn't there: exit 1"
scan --depth kinect:1
[ $status -eq 2 ] && one_error "no driver is called 'kinect'"
check "an unknown driver: exit 2"
scan --depth rig --imu deaf
[ $status -eq 1 ] && one_error 'there are no samples in imu.txt'
check "an IMU that was asked for and gives nothing: exit 1"
scan --depth rig --mesh none/m.ply
[ $status -eq 1 ] && one_error 'none/m.ply: can.t be written'
check "a place that can't be written to: exit 1"
scan --depth rig --speed -1
[ $status -eq 2 ] && one_error -- '--speed'
check "a wrong value: exit 2"
scan --dept rig
[ $status -eq 2 ] && one_error 'unknown option --dept'
check "an unknown option: exit 2"
scan rig
[ $status -eq 2 ] && one_error 'takes no rig'
check "a word: exit 2"

cp -r rig hurt && frame=$(grep -v '^#' rig/depth.txt | sed -n 5p | cut -d' ' -f2) && head -c 300 "rig/$frame" >"hurt/$frame"
scan --depth hurt --speed 0
[ $status -eq 0 ] && grep -q "warning: hurt/$frame" err && [ "$(figure frames)" -eq 59 ] && [ "$(figure frames_missing)" -eq 1 ]
check "a damaged frame is left out, said and counted"

if [ -c /dev/full ]; then
    "$fathom" scan --depth rig --frames 3 --json >/dev/full 2>err
    [ $? -eq 1 ] && grep -q 'standard output' err
    check "a full disk behind stdout: exit 1"
fi

# ---- devices

"$fathom" devices >out 2>err
[ $? -eq 0 ] && grep -q '^folder: ' out && grep -q openni2 out
check "devices: exit 0, every driver has its word"
"$fathom" devices --json >out 2>err && python3 -c '
import json
seen = [json.loads(line) for line in open("out")]
assert {"folder", "openni2", "hid", "usb", "iio", "udp"} <= {s["driver"] for s in seen}
assert all(s["problem"] for s in seen if s["error"])'
check "devices --json"
"$fathom" info >out 2>err
[ "$(grep -c '^driver: ' out)" -eq 6 ] && grep -q '^driver: folder .*: built in' out
check "info lists the drivers"

# ---- a camera by the real libOpenNI2: a virtual one, in a private folder (see test_openni2.c)

virtual=$build/tests/openni2/libVirtualDepth.so.0
library=$(ldd "$fathom" | sed -n 's/.*libOpenNI2.so.0 => \([^ ]*\).*/\1/p')
if [ -f "$virtual" ] && [ -n "$library" ]; then
    mkdir -p private/OpenNI2/Drivers && cp "$library" private/ && cp "$virtual" private/OpenNI2/Drivers/
    export LD_LIBRARY_PATH="$work/private" VIRTUAL_DEPTH_FOLDER="$work/units" VIRTUAL_DEPTH_CONTROL="$work/control" VIRTUAL_DEPTH_RATE=30
    echo good >control
    "$fathom" simulate desk units --frames 20 --size 160x120 --still 5 >out 2>err
    "$fathom" devices >out 2>err
    [ $? -eq 0 ] && grep -q '^depth: Virtual Depth 1, serial VIRTUAL-1$' out && grep -q 'depth openni2:virtual/depth@9/1' out
    check "devices: cameras with their serials and addresses"
    # The virtual camera calls the recording's fifths of a millimetre millimetres.
    scan --imu none --frames 25 --depth-scale 5000 --intrinsics 131.25,131.25,79.5,59.5 --trajectory t.txt
    [ $status -eq 0 ] && [ "$(figure frames)" -eq 25 ] && [ "$(figure tracked)" -eq 25 ] && [ "$(lines t.txt)" -eq 25 ]
    check "without --depth: the first camera that can be opened"
    (sleep 2 && echo unplugged >control) &
    scan --depth openni2:VIRTUAL-1 --imu none --depth-scale 5000 --reconnect off --mesh u.ply
    [ $status -eq 1 ] && one_error 'the depth camera was unplugged' && [ "$(figure frames)" -gt 5 ] && whole_ply u.ply
    check "unplugged: exit 1 and the mesh whole"
    echo good >control
    (sleep 2 && echo unplugged >control && sleep 0.5 && echo good >control) &
    scan --depth openni2:VIRTUAL-1 --imu none --depth-scale 5000 --duration 5
    [ $status -eq 0 ] && grep -q 'was unplugged; it is looked for' err && grep -q 'is back' err
    check "plugged in again: the scan goes on"
else
    for text in "devices: cameras" "the first camera" "unplugged" "plugged in again"; do
        skip "$text" "built without OpenNI2 or its virtual camera"
    done
fi

echo "1..$number"
[ "$failed" -eq 0 ]
