"""Writes small good .oni recordings to start fuzz_oni from: seed_oni.py FOLDER."""
import os
import struct
import sys


def record(kind, fields=b"", payload=b""):
    return struct.pack("<4sIIIIQ", b"NIR\0", kind, 1, 28 + len(fields), len(payload), 0) + fields + payload


def name(text):
    return struct.pack("<I", len(text) + 1) + text.encode() + b"\0"


def value(data):
    return struct.pack("<I", len(data)) + data


def recording(codec, frame):
    out = struct.pack("<4sBBHIQI", b"NI10", 1, 0, 1, 0, 1000, 1)
    out += record(13, name("Depth") + struct.pack("<I4sIQQQ", 2, codec, 2, 0, 1000, 0))
    out += record(6, name("xnMapOutputMode") + value(struct.pack("<III", 8, 8, 30)))
    out += record(6, name("xnFOV") + value(struct.pack("<dd", 1.0, 0.8)))
    out += record(3, name("xnMirror") + value(struct.pack("<q", 1)))
    out += record(3, name("oniPixelFormat") + value(struct.pack("<q", 100)))
    for i in range(2):
        out += record(10, struct.pack("<QI", 1000 * i, i + 1), frame)
    return out + record(11)


folder = sys.argv[1]
os.makedirs(folder, exist_ok=True)
for codec, frame in (
    (b"NONE", bytes(128)),
    (b"16zP", b"\x10\x27\x5f\xff\x90\xff\x12\x34" + b"\xf0" + b"\xfc" + b"\x66\x66"),
    (b"16zT", b"\x03\x00" + b"\x0a\x00\x14\x00\x1e\x00" + b"\x01\x00" + b"\x57" + b"\xfe\xe1" + b"\x6f"),
):
    with open(os.path.join(folder, codec.decode().strip()), "wb") as out:
        out.write(recording(codec, frame))
