#!/bin/sh
# A pool that is too small, end to end: what makes room is kept in a file, comes back, and is in the mesh.
# Usage: sh tests/e2e/when_full.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
own_caches
export TMPDIR="$work/tmp"
mkdir -p "$work/tmp" "$work/mesh"

faces() { head -c 1000 "$1" | sed -n 's/^element face //p'; }
note() { sed -n "s/^fathom: note: $1\$/\\1/p" err; } # what the words' \(...\) match
dropped() { note '\([0-9]*\) blocks of the surface made room for others.*'; }
returned() { note '.* made room for others, \([0-9]*\) came back; .*'; }

# near A B PERMILLE: A is B but for so much.
near() { [ $((1000 * $1)) -ge $(((1000 - $3) * $2)) ] && [ $((1000 * $1)) -le $(((1000 + $3) * $2)) ]; }

# Nothing but the mesh is left, beside it and in the folder for temporary files.
only_mesh() { [ "$(ls mesh)" = "$1" ] && [ -z "$(ls tmp)" ]; }

run "$fathom" simulate room room --frames 150 --size 160x120 --clean
[ $status -eq 0 ]
check "a walk through a room"

run "$fathom" replay room --voxel 0.02 --mesh mesh/large.ply
large=$(faces mesh/large.ply)
[ $status -eq 0 ] && [ "$large" -gt 100000 ] && [ ! -s err ]
check "with room for all of it: nothing is said"
rm mesh/large.ply

# The least memory that is accepted, and 3 MB of blocks: more than one view, half the room.
memory=3
status=2
while [ $status -eq 2 ] && [ $memory -lt 32 ]; do
    memory=$((memory + 1))
    run "$fathom" replay room --voxel 0.02 --stride 150 --memory $memory
done
memory=$((memory + 3))

run "$fathom" replay room --voxel 0.02 --memory $memory --mesh mesh/stop.ply
[ $status -eq 0 ] && [ "$(faces mesh/stop.ply)" -lt $((large * 85 / 100)) ] && grep -q 'warning: .*pool is full' err
check "--when-full stop: the mesh lacks what found no room"
rm mesh/stop.ply

memory=$((memory + 1)) # for the patch that stored blocks are meshed in
run "$fathom" replay room --voxel 0.02 --memory $memory --when-full drop --mesh mesh/drop.ply
[ $status -eq 0 ] && [ "$(dropped)" -gt 500 ] && near "$(faces mesh/drop.ply)" "$large" 10 && only_mesh drop.ply
check "--when-full drop: the mesh is whole but for a hundredth, the file is gone"
rm mesh/drop.ply

run "$fathom" scan --depth room --imu room --speed 0 --voxel 0.02 --memory $memory --when-full drop --mesh mesh/live.ply
[ $status -eq 0 ] && [ "$(dropped)" -gt 500 ] && near "$(faces mesh/live.ply)" "$large" 10 && only_mesh live.ply
check "the same live"
rm mesh/live.ply

# There, back and there again.
cp -r room back
awk '!/^#/ { file[n++] = $2 } END { for (i = 0; i < 3 * n - 2; i++) {
    k = i % (2 * n - 2); if (k >= n) k = 2 * n - 2 - k; printf "%.6f %s\n", i / 30, file[k] } }' room/depth.txt >back/depth.txt
run "$fathom" replay back --imu none --voxel 0.02 --memory $memory --when-full drop --mesh mesh/back.ply
[ $status -eq 0 ] && [ "$(returned)" -gt 500 ] && near "$(faces mesh/back.ply)" "$large" 10 && only_mesh back.ply
check "the camera returns: blocks come back and are in the mesh once"
rm mesh/back.ply

# ---- where the file can't be, or not grow

TMPDIR=$work/nowhere run "$fathom" replay room --voxel 0.02 --memory $memory --when-full drop
[ $status -eq 1 ] && [ "$(wc -l <err)" -eq 1 ] && grep -q "nowhere/fathom.blocks.*: .*can't be made: No such file" err && [ ! -s out ]
check "no place for the file is known before the scan"

mkdir tiny
if unshare -m mount -t tmpfs -o size=256k none tiny 2>/dev/null; then
    run unshare -m sh -c 'mount -t tmpfs -o size=256k none tiny && TMPDIR=tiny exec "$@"' sh \
        "$fathom" replay room --voxel 0.02 --memory $memory --when-full drop --trajectory t.txt
    [ $status -eq 1 ] && [ "$(grep -vc '^fathom: note: ' err)" -eq 1 ] &&
        grep -q "^fathom: tiny/.*can't be kept: No space left on device" err && [ "$(wc -l <t.txt)" -eq 150 ] &&
        tail -n 1 out | grep -q '^frames=150 tracked=150 '
    check "a full disk: said once, exit 1, the scan and the trajectory whole"
else
    skip "a full disk" "no tmpfs can be mounted here"
fi

(ulimit -f 700 && exec "$fathom" replay room --voxel 0.02 --memory $memory --when-full drop --trajectory t.txt) >out 2>err
status=$?
[ $status -eq 1 ] && [ "$(grep -vc '^fathom: note: ' err)" -eq 1 ] &&
    [ "$(note '\([0-9]*\) blocks that made room .*')" -gt 100 ] && [ "$(wc -l <t.txt)" -eq 150 ]
check "a file that may not grow: what is lost is counted"

echo "1..$number"
[ $failed -eq 0 ]
