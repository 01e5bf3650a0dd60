#!/bin/sh
# Bad input, end to end: what `fathom replay` says, how it exits, and that nothing good is lost.
# Usage: sh tests/e2e/replay_errors.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
own_caches

# A fresh copy of the good recording.
fresh() { rm -rf r && cp -r good r; }

# replay OPTIONS...: into out, err and $status.
replay() { run "$fathom" replay "$@"; }

summary() { tail -n 1 out | grep -q "^frames=$1 tracked="; }

"$fathom" simulate desk good --frames 8 --size 320x240 --still 0 >out 2>err
status=$?
[ $status -eq 0 ] && [ "$(grep -vc '^#' good/depth.txt)" -eq 8 ]
check "a recording to spoil"
frame4=$(grep -v '^#' good/depth.txt | sed -n 5p | cut -d' ' -f2)

replay good --trajectory t.txt --odometry o.txt --stats s.csv --mesh m.ply --picture p.png
[ $status -eq 0 ] && summary 8 && [ "$(lines t.txt)" -eq 8 ] && [ "$(awk 'NF == 8' o.txt | wc -l)" -eq 8 ] && [ "$(lines s.csv)" -eq 9 ] && whole_ply m.ply &&
    [ -s p.png ] && [ ! -s err ] && [ -z "$(ls ./*.part 2>/dev/null)" ]
check "the good recording: exit 0, all files whole, nothing on stderr"

# ---- files of the recording

replay nowhere
[ $status -eq 1 ] && one_error 'nowhere/depth.txt: No such file'
check "missing folder"

fresh && rm r/depth.txt
replay r
[ $status -eq 1 ] && one_error 'r/depth.txt: No such file'
check "missing depth.txt"

fresh && echo 'rubbish depth/x.png' >>r/depth.txt
replay r
[ $status -eq 1 ] && one_error "r/depth.txt:$(lines r/depth.txt): "
check "a line of depth.txt that can't be read"

fresh && head -c 3000 "good/$frame4" >"r/$frame4"
rm -f t.txt s.csv m.ply p.png
replay r --trajectory t.txt --stats s.csv --mesh m.ply --picture p.png
[ $status -eq 1 ] && one_error "r/$frame4: " && [ "$(lines t.txt)" -eq 4 ] && [ "$(lines s.csv)" -eq 5 ] &&
    whole_ply m.ply && [ -s p.png ] && summary 4
check "truncated PNG: exit 1, trajectory, mesh, picture whole up to it"

fresh && rm "r/$frame4"
replay r --trajectory t.txt
[ $status -eq 1 ] && one_error "r/$frame4: No such file" && [ "$(lines t.txt)" -eq 4 ]
check "missing PNG"

"$fathom" simulate desk other --frames 1 --size 160x120 >/dev/null 2>&1
fresh && cp other/depth/*.png "r/$frame4"
replay r --trajectory t.txt
[ $status -eq 1 ] && one_error "r/$frame4: 160x120, where the recording's frames are 320x240" &&
    [ "$(lines t.txt)" -eq 4 ]
check "a frame of another size: both sizes named"

fresh && awk '!/^#/ { n++ } n == 5 { print; print $1 - 0.02, $2; n++; next } { print }' good/depth.txt >r/depth.txt
replay r --trajectory t.txt
[ $status -eq 0 ] && one_warning 'r/depth.txt:[0-9]*: time stamp goes back' && [ "$(lines t.txt)" -eq 8 ]
check "a stamp that goes back: that frame skipped"

fresh && awk '/^#/ { print; next } { n++ } n == 10 { $2 = "nan" } n == 20 { $1 -= 1 } n == 30 { NF = 4 } { print }' \
    good/imu.txt >r/imu.txt
replay r
[ $status -eq 0 ] && summary 8 &&
    one_warning 'r/imu.txt:[0-9]*: the first of 3 lines left out (1 unreadable, 1 not finite, 1 out of order)'
check "NaN, short and out-of-order IMU lines: counted, skipped, replayed"

replay good --imu nowhere.txt
[ $status -eq 1 ] && one_error 'nowhere.txt: No such file'
check "a missing file for --imu"

fresh && echo '0 0 160 120' >r/calibration.txt
replay r
[ $status -eq 1 ] && one_error 'r/calibration.txt:1: .*above zero'
check "zero intrinsics in calibration.txt"

replay good --intrinsics 1,1,0.5,0.5
[ $status -eq 2 ] && one_error 'intrinsics 1,1,0.5,0.5'
check "nonsense intrinsics as an option: exit 2"

fresh && echo 'depth_scale five' >>r/rig.txt
replay r
[ $status -eq 1 ] && one_error 'r/rig.txt:[0-9]*: depth_scale takes 1 number'
check "a value of rig.txt that can't be read"

fresh && sed 's/^depth_scale .*//' good/rig.txt >r/rig.txt && rm r/calibration.txt
"$fathom" replay r >out 2>err
status=$?
grep -q 'note: .*262.5 262.5 159.5 119.5' err && grep -q 'note: .*5000 units a metre' err
check "a folder without calibration.txt and depth_scale: the TUM defaults, said so"

scale=$(sed -n 's/^depth_scale *//p' good/rig.txt)
if [ "$scale" = 1000 ]; then
    one_warning 'nothing states the depth scale.* 1000 is likelier'
    check "millimetres taken for TUM's scale: the likelier one named"
fi

# ---- the machine

fresh
rm -f t.txt m.ply
(ulimit -f 200 && exec "$fathom" replay r --trajectory t.txt --mesh m.ply --voxel 0.005) >out 2>err
status=$?
[ $status -eq 1 ] && one_error '^fathom: m.ply: ' && [ "$(lines t.txt)" -eq 8 ] && [ ! -e m.ply ] &&
    [ -z "$(ls m.ply* 2>/dev/null)" ] && summary 8
check "no room for the mesh: exit 1, no torn file, trajectory whole"

echo old >m.ply
(ulimit -f 200 && exec "$fathom" replay r --mesh m.ply --voxel 0.005) >out 2>err
status=$?
[ $status -eq 1 ] && [ "$(cat m.ply)" = old ]
check "no room for the mesh: the one that was there stays"

if [ -c /dev/full ]; then
    rm -f m.ply
    replay r --trajectory /dev/full --mesh m.ply
    [ $status -eq 1 ] && one_error '^fathom: /dev/full: No space left' && whole_ply m.ply && summary 8
    check "no room for the trajectory: exit 1, the mesh whole"
fi

replay r --trajectory nowhere/t.txt
[ $status -eq 1 ] && one_error 'nowhere/t.txt: No such file'
check "a trajectory that can't be written"

replay r --mesh nowhere/m.ply
[ $status -eq 1 ] && one_error 'nowhere/m.ply: '
check "a mesh that can't be written is known before the scan"

OCL_ICD_VENDORS="$PWD/nowhere" "$fathom" replay r >out 2>err
status=$?
[ $status -eq 1 ] && one_error 'OpenCL platform'
check "no OpenCL platform"

replay r --device no-such-device
[ $status -eq 1 ] && one_error 'no-such-device'
check "a device that isn't there"

# The least memory that is accepted leaves a pool far too small for fine voxels.
memory=4
replay r --memory $memory --voxel 0.003 --mesh m.ply
[ $status -eq 2 ] && one_error 'memory'
check "a memory cap that can't hold the settings: exit 2"
while [ $status -eq 2 ] && [ $memory -lt 64 ]; do
    memory=$((memory + 1))
    replay r --memory $memory --voxel 0.003 --mesh m.ply
done
[ $status -eq 0 ] && grep -q 'warning: .*pool is full' err && whole_ply m.ply && summary 8
check "a full block pool: a warning, and the scan goes on"

# Many frames from few: there and back again, so that tracking has nothing to complain about.
fresh
awk '!/^#/ { file[n++] = $2 } END { for (i = 0; i < 3000; i++) {
    k = i % (2 * n - 2); if (k >= n) k = 2 * n - 2 - k; printf "%.6f %s\n", i / 30, file[k] } }' good/depth.txt >r/depth.txt
rm -f t.txt s.csv m.ply p.png
: >t.txt
"$fathom" replay r --imu none --trajectory t.txt --stats s.csv --mesh m.ply --picture p.png >out 2>err &
pid=$!
waited=0
while [ "$(lines t.txt)" -lt 3 ] && [ $waited -lt 600 ]; do
    sleep 0.1
    waited=$((waited + 1))
done
kill -INT $pid
wait $pid
status=$?
[ $status -eq 130 ] && [ "$(lines t.txt)" -ge 3 ] && summary "$(lines t.txt)" &&
    [ "$(lines s.csv)" -eq $(($(lines t.txt) + 1)) ] && [ "$(awk 'NF != 8' t.txt | wc -l)" -eq 0 ] &&
    whole_ply m.ply && [ -s p.png ]
check "Ctrl-C: exit 130, all files whole"

"$fathom" simulate desk half --size 160x120 --threads 1 >out 2>err &
pid=$!
waited=0
while [ "$(cat half/depth.txt 2>/dev/null | wc -l)" -lt 6 ] && [ $waited -lt 600 ]; do
    sleep 0.05
    waited=$((waited + 1))
done
kill -INT $pid
wait $pid
status=$?
frames=$(grep -vc '^#' half/depth.txt)
[ $status -eq 130 ] && [ "$(figure frames)" -eq "$frames" ] && [ "$frames" -lt 200 ] && [ -z "$(ls half/depth/*.part 2>/dev/null)" ] &&
    replay half && summary "$frames"
check "Ctrl-C while simulating: exit 130, what is there can be replayed"

cp r/rig.txt before
"$fathom" calibrate r --progress >out 2>err &
pid=$!
waited=0
while [ "$(lines err)" -lt 3 ] && [ $waited -lt 600 ]; do
    sleep 0.05
    waited=$((waited + 1))
done
kill -INT $pid
wait $pid
status=$?
[ $status -eq 130 ] && cmp -s before r/rig.txt && [ ! -e r/rig.txt.part ] && [ ! -s out ]
check "Ctrl-C while calibrating: exit 130, rig.txt untouched"

# ---- usage

# wrong TEXT ARGUMENTS...: exit 2 with one line that holds the text.
wrong() {
    words=$1
    shift
    replay "$@"
    [ $status -eq 2 ] && one_error "$words" && [ ! -s out ]
    check "usage: replay $*"
}
wrong 'no folder'
wrong 'more than one folder' good good
wrong 'unknown option --colour' good --colour
wrong 'needs a value' good --mesh
wrong 'takes no value' good --progress=yes
wrong '--stride' good --stride 0
wrong '--stride' good --stride 2x
wrong '--voxel' good --voxel nan
wrong '--voxel' good --voxel -0.01
wrong '--depth-scale' good --depth-scale 0
wrong '--intrinsics' good --intrinsics 500,500,300
wrong '--intrinsics' good --intrinsics 500,500,300,200,1
wrong '--intrinsics' good --intrinsics 0,500,300,200
wrong '--iterations' good --iterations 1,2
wrong '--iterations' good --iterations 0,0,0
wrong '--iterations' good --iterations 0.5,1,1
wrong '--iterations' good --iterations 0,0,101
wrong '--size' good --size 320
wrong '--size' good --size 320x240x3
wrong '--threads' good --threads 0
wrong '--memory' good --memory lots
wrong '--against' good --against world
wrong '--translation' good --translation maybe
wrong '--outage' good --outage 5
wrong '--outage' good --outage 5:5
wrong '--outage' good --outage 5:6,
wrong '--outage' good --outage 100:110
wrong '--wall' good --wall 7:3
fresh && rm r/groundtruth.txt
wrong 'groundtruth' r --wall 2:4
wrong 'not yet available' good --report r.html
wrong 'not yet available' good --save-map m
wrong 'not yet available' good --resume m
wrong 'not yet available' good/depth.txt

echo "1..$number"
[ $failed -eq 0 ]
