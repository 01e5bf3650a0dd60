#!/bin/sh
# Live rigs recorded into a folder, end to end, with recordings in the place of devices.
# Usage: sh tests/e2e/log.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"
own_caches

# record OPTIONS...: into out, err and $status.
record() { run "$fathom" log "$@"; }
frames_in() { grep -vc '^#' "$1/depth.txt"; }

# same A B: B's frames are A's, pixel for pixel, and its samples are A's up to one beyond the last frame. Stamps to the
# nanosecond, values as the floats that they are.
same() {
    python3 - "$1" "$2" <<'END'
import struct, sys, zlib
from decimal import Decimal

def lines(path):
    return [l.split() for l in open(path) if not l.startswith("#")]

def pixels(path):  # greyscale of 16 bits
    data, at, packed = open(path, "rb").read(), 8, b""
    while at < len(data):
        n, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + n]
        if kind == b"IHDR": width, height, bits, colour = struct.unpack(">IIBB", body[:10])
        if kind == b"IDAT": packed += body
        at += 12 + n
    assert bits == 16 and colour == 0
    raw, row, out = zlib.decompress(packed), bytearray(2 * width), []
    for y in range(height):
        kind, line = raw[y * (2 * width + 1)], bytearray(raw[y * (2 * width + 1) + 1:(y + 1) * (2 * width + 1)])
        assert kind in (0, 1)
        for i in range(2, len(line) if kind else 0): line[i] = (line[i] + line[i - 2]) & 255
        out.append(bytes(line))
    return width, height, out

def floats(words):
    return struct.pack("6f", *map(float, words))

a, b = sys.argv[1:]
da, db = lines(a + "/depth.txt"), lines(b + "/depth.txt")
assert [Decimal(t) for t, _ in da] == [Decimal(t) for t, _ in db] and len(db) > 1, "stamps of frames"
for (_, fa), (_, fb) in zip(da, db):
    assert pixels(a + "/" + fa) == pixels(b + "/" + fb), fa
ia, ib = lines(a + "/imu.txt"), lines(b + "/imu.txt")
assert Decimal(ib[-1][0]) > Decimal(db[-1][0]), "samples end before the frames"
assert len(ia) >= len(ib) >= sum(Decimal(s[0]) <= Decimal(da[-1][0]) for s in ia) + 1, "number of samples"
for sa, sb in zip(ia, ib):
    assert Decimal(sa[0]) == Decimal(sb[0]) and floats(sa[1:]) == floats(sb[1:]), sa
END
}

# whole FOLDER: every frame that depth.txt names is there, both text files end with a line's end, a replay takes it all.
whole() {
    [ -z "$(tail -c 1 "$1/depth.txt")" ] && [ -z "$(tail -c 1 "$1/imu.txt")" ] &&
        [ "$(awk '!/^#/ && NF != 7' "$1/imu.txt" | wc -l)" -eq 0 ] &&
        grep -v '^#' "$1/depth.txt" | while read -r _ file; do [ -s "$1/$file" ] || exit 1; done &&
        "$fathom" replay "$1" --trajectory replay.txt >replay.out 2>replay.err && [ ! -s replay.err ] &&
        [ "$(wc -l <replay.txt)" -eq "$(frames_in "$1")" ]
}

"$fathom" simulate desk rig --frames 40 --size 160x120 --still 0.3 >out 2>err
check "a rig to record"

record copy --depth rig --speed 0
[ $status -eq 0 ] && [ ! -s err ] && [ "$(figure frames)" -eq 40 ] && [ "$(figure frames_dropped)" -eq 0 ] &&
    [ "$(figure samples_dropped)" -eq 0 ] && [ "$(figure samples)" -eq "$(grep -vc '^#' copy/imu.txt)" ] &&
    [ "$(figure seconds)" = 1.300 ] &&
    [ "$(figure bytes)" -eq "$(cat copy/depth/*.png copy/depth.txt copy/imu.txt | wc -c)" ] && same rig copy
check "as fast as it goes: the same stamps, pixels and samples"

grep -v '^#' rig/rig.txt | sort >a && sort copy/rig.txt | cmp -s a - && cmp -s rig/calibration.txt copy/calibration.txt &&
    "$fathom" replay rig --trajectory a >out 2>err && "$fathom" replay copy --trajectory b >out 2>err && cmp -s a b
check "mounting and intrinsics too: a replay of it is byte for byte that of the original"

record again --depth copy --speed 0
[ $status -eq 0 ] && sed 1d copy/imu.txt >a && sed 1d again/imu.txt | cmp -s a - && sed 1d copy/depth.txt >a &&
    sed 1d again/depth.txt | cmp -s a - && diff -r copy/depth again/depth >/dev/null
check "a recording of the recording: the same files"

record live --depth rig --json
[ $status -eq 0 ] && same rig live && python3 - <<'END'
import json
lines = [json.loads(line) for line in open("out")]
states, summary = lines[:-1], lines[-1]["summary"]
assert summary["frames"] == 40 and summary["frames_dropped"] == 0 and summary["samples_dropped"] == 0
assert len(states) >= 1 and all(s["depth"] in ("running", "at end") and s["imu"] in ("running", "at end") for s in states)
assert list(summary) == ["frames", "samples", "frames_dropped", "samples_dropped", "bytes", "seconds"]
END
check "in real time: nothing lost; --json"

record few --depth rig --speed 0 --frames 7
[ $status -eq 0 ] && [ "$(figure frames)" -eq 7 ] && [ "$(frames_in few)" -eq 7 ] && [ "$(figure samples)" -lt 100 ] && whole few
check "--frames ends it"

record short --depth rig --duration 0.5
[ $status -eq 0 ] && [ "$(figure frames)" -ge 5 ] && [ "$(figure frames)" -le 17 ] && whole short
check "--duration ends it"

# Far more frames than 30 at once: the oldest that wait are dropped.
cp -r rig many && awk '!/^#/ { file[n++] = $2 } END { for (i = 0; i < 600; i++) printf "%.6f %s\n", i / 30, file[i % n] }' rig/depth.txt >many/depth.txt
record slow --depth many --imu none --speed 1000
[ $status -eq 0 ] && [ "$(figure frames)" -ge 30 ] && [ "$(frames_in slow)" -eq "$(figure frames)" ] &&
    [ $(($(figure frames) + $(figure frames_dropped))) -eq 600 ] &&
    { [ "$(figure frames_dropped)" -eq 0 ] || grep -q 'warning: slow: writing is too slow' err; }
check "faster than it can be written: dropped frames are counted, and said"

record deaf --depth rig --imu none --speed 0
[ $status -eq 0 ] && [ "$(figure samples)" -eq 0 ] && [ ! -e deaf/imu.txt ] && [ "$(frames_in deaf)" -eq 40 ]
check "--imu none: no imu.txt"

mkdir mount && printf '# by hand\nimu_to_camera_rotation 0 0 90\nimu_clock_offset 0.25\ndepth_scale 1000\n' >mount/rig.txt &&
    echo '140 141 80 60 0.1 0 0 0' >mount/calibration.txt
record mounted --depth rig --rig mount --speed 0
[ $status -eq 0 ] && [ "$(cat mounted/rig.txt)" = "depth_scale 5000
# by hand
imu_to_camera_rotation 0 0 90
imu_clock_offset 0.25" ] && [ "$(cut -d' ' -f1-4 mounted/calibration.txt)" = "140 141 80 60" ] &&
    [ "$(wc -w <mounted/calibration.txt)" -eq 9 ]
check "--rig: its mounting and intrinsics, the camera's depth scale"

# ---- stopped

"$fathom" log stopped --depth rig --speed 0.5 >out 2>err &
recording=$!
tries=0
while [ "$(cat stopped/depth.txt 2>/dev/null | wc -l)" -lt 12 ] && [ $tries -lt 200 ]; do sleep 0.05 && tries=$((tries + 1)); done
kill -TERM $recording # a background job of a script ignores INT
wait $recording
status=$?
[ $status -eq 130 ] && [ "$(frames_in stopped)" -eq "$(figure frames)" ] && [ "$(figure frames)" -ge 10 ] &&
    [ "$(figure frames)" -lt 40 ] && [ "$(figure frames_dropped)" -eq 0 ] && whole stopped
check "stopped: exit 130, the folder whole"

"$fathom" log killed --depth rig --speed 0.5 >out 2>err &
recording=$!
tries=0
while [ "$(cat killed/depth.txt 2>/dev/null | wc -l)" -lt 32 ] && [ $tries -lt 200 ]; do sleep 0.05 && tries=$((tries + 1)); done
kill -KILL $recording
wait $recording 2>/dev/null
frames=$(frames_in killed)
[ "$frames" -ge 30 ] && [ "$frames" -lt 40 ] && whole killed && [ "$(ls killed/depth/*.png | wc -l)" -le $((frames + 1)) ] &&
    awk -v last="$(tail -n 1 killed/depth.txt | cut -d' ' -f1)" 'END { exit !($1 > last - 0.5) }' killed/imu.txt
check "killed: what is there can be replayed, less than a second is missing"

# ---- a full disk, by a limit on the size of files

"$fathom" simulate desk fast --frames 30 --size 160x120 --imu-rate 1000 >out 2>err
(ulimit -f 80 && exec "$fathom" log narrow --depth fast --speed 0.8) >out 2>err
status=$?
[ $status -eq 1 ] && one_error '^fathom: narrow/imu.txt: File too large' && [ "$(wc -c <narrow/imu.txt)" -gt 20000 ] && whole narrow &&
    [ "$(frames_in narrow)" -eq "$(figure frames)" ] && [ "$(figure samples)" -eq "$(grep -vc '^#' narrow/imu.txt)" ]
check "no room for a sample: the file named, exit 1, whole lines"

# The frames from the 20th on are noise, which no PNG of this size holds within the limit.
cp -r rig noisy && python3 - <<'END'
import os, struct, zlib
def chunk(kind, body): return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
rows = b"".join(b"\0" + os.urandom(320) for _ in range(120))
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 160, 120, 16, 0, 0, 0, 0))
png += chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
for line in [l for l in open("rig/depth.txt") if not l.startswith("#")][19:]:
    open("noisy/" + line.split()[1], "wb").write(png)
END
head -n 100 rig/imu.txt >noisy/imu.txt
(ulimit -f 60 && exec "$fathom" log full --depth noisy --speed 0) >out 2>err
status=$?
[ $status -eq 1 ] && one_error '^fathom: full/depth/0*\.[0-9]*\.png: File too large' && [ "$(frames_in full)" -eq 19 ] &&
    [ "$(figure frames)" -eq 19 ] && [ "$(ls full/depth | wc -l)" -eq 19 ] && whole full
check "no room for a frame: the file named, exit 1, what came before whole"

# A real one, where a file system can be mounted.
if unshare -rm true 2>/dev/null; then
    mkdir disk
    unshare -rm sh -c 'mount -t tmpfs -o size=400k none disk && "$1" log disk/log --depth rig --speed 0 >out 2>err
        status=$?
        cp -r disk/log disk-kept
        exit $status' sh "$fathom"
    status=$?
    [ $status -eq 1 ] && one_error '^fathom: disk/log/.*: No space left on device' && [ "$(frames_in disk-kept)" -ge 5 ] && whole disk-kept
    check "a full disk: the same"
else
    skip "a full disk: the same" "nothing can be mounted here"
fi

if [ -c /dev/full ]; then
    "$fathom" log nowhere --depth rig --frames 3 --speed 0 >/dev/full 2>err
    [ $? -eq 1 ] && grep -q 'standard output' err && whole nowhere
    check "a full disk behind stdout: exit 1, the folder whole"
fi

# ---- mistakes

cp -r copy kept
record copy --depth rig --speed 0
[ $status -eq 1 ] && one_error "copy: isn.t empty; --force" && diff -r kept copy >/dev/null
check "a folder that holds a recording is refused and left alone"
record copy --depth rig --speed 0 --frames 3 --force
[ $status -eq 0 ] && [ "$(ls copy/depth | wc -l)" -eq 3 ] && whole copy
check "--force: nothing is left of the former recording"
record rig --depth folder:rig --force
[ $status -eq 2 ] && one_error "rig: can.t be read from and recorded into" && [ "$(ls rig/depth | wc -l)" -eq 40 ]
check "the recording that is read is not recorded into"
record mount --depth rig --rig mount/ --force
[ $status -eq 2 ] && one_error "can.t be read from" && [ -s mount/rig.txt ]
check "nor the rig's own folder"
record new --depth nowhere/there
[ $status -eq 2 ] && one_error 'nowhere/there: neither a folder' && [ ! -e new ]
check "a source that isn't there: exit 2, no folder made"
record err/new --depth rig
[ $status -eq 1 ] && one_error 'err/new: Not a directory'
check "a folder that can't be made: exit 1"
record
[ $status -eq 2 ] && one_error 'no folder given'
check "no folder: exit 2"
record a b --depth rig
[ $status -eq 2 ] && one_error 'more than one folder'
check "two folders: exit 2"
record new --speed x
[ $status -eq 2 ] && one_error '--speed'
check "a wrong value: exit 2"
record new --mesh m.ply
[ $status -eq 2 ] && one_error 'log: unknown option --mesh'
check "an unknown option: exit 2"
record --help
[ $status -eq 0 ] && [ ! -s err ] && for option in --depth --imu --rig --speed --duration --frames --force --json --reconnect; do
    grep -q -e " $option" out || exit 1
done
check "--help lists the options"

# ---- a camera by the real libOpenNI2: a virtual one, in a private folder (see test_openni2.c)

virtual=$build/tests/openni2/libVirtualDepth.so.0
library=$(ldd "$fathom" | sed -n 's/.*libOpenNI2.so.0 => \([^ ]*\).*/\1/p')
if [ -f "$virtual" ] && [ -n "$library" ]; then
    mkdir -p private/OpenNI2/Drivers && cp "$library" private/ && cp "$virtual" private/OpenNI2/Drivers/
    export LD_LIBRARY_PATH="$work/private" VIRTUAL_DEPTH_FOLDER="$work/rig" VIRTUAL_DEPTH_CONTROL="$work/control" VIRTUAL_DEPTH_RATE=30
    echo good >control
    (sleep 1.5 && echo unplugged >control) &
    record camera --depth openni2:VIRTUAL-1 --imu none --reconnect off
    [ $status -eq 1 ] && one_error 'the depth camera was unplugged' && [ "$(figure frames)" -gt 5 ] &&
        [ "$(frames_in camera)" -eq "$(figure frames)" ] && grep -qx 'depth_scale 1000' camera/rig.txt && touch camera/imu.txt && whole camera
    check "a camera, unplugged: exit 1, the folder whole"
else
    skip "a camera, unplugged" "built without OpenNI2 or its virtual camera"
fi

echo "1..$number"
[ "$failed" -eq 0 ]
