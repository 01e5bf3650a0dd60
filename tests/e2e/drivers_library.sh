#!/bin/sh
# libfathom-drivers as a shared library: its surface, and its use from another language.
# Usage: sh tests/e2e/drivers_library.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"
cd "$(dirname "$0")/../.." || exit 1
so=${1:?usage: sh tests/e2e/drivers_library.sh BUILD_DIR}/libfathom-drivers.so
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
out=$work/out
version=$(sed -n 's/.define FATHOM_VERSION_M[A-Z]*OR *//p' lib/fathom.h | paste -sd.)

nm -D --defined-only "$so" | awk '{print $NF}' | LC_ALL=C sort >"$work/exported"
diff tests/abi/libfathom-drivers.symbols "$work/exported" >"$out"
check "it exports the symbols of tests/abi/libfathom-drivers.symbols, and no other" "$out"

sed -n 's/^FATHOM_API.*[ *]\(fathom_[a-z_0-9]*\)(.*/\1/p' drivers/fathom_drivers.h | LC_ALL=C sort >"$work/declared"
diff "$work/declared" "$work/exported" >"$out"
check "it exports what the header declares" "$out"

readelf -d "$so" >"$out" && grep -q "SONAME.*\[libfathom-drivers\.so\.$version\]" "$out"
check "its soname is libfathom-drivers.so.$version" "$out"

! grep -q 'NEEDED.*libfathom' "$out"
check "it doesn't need libfathom.so" "$out"

python3 - "$so" >"$out" 2>&1 <<'END'
import ctypes, sys

library = ctypes.CDLL(sys.argv[1])

class Info(ctypes.Structure):
    _fields_ = [("struct_size", ctypes.c_uint32), ("kinds", ctypes.c_uint32), ("driver", ctypes.c_char_p),
                ("uri", ctypes.c_char * 256), ("name", ctypes.c_char * 96), ("serial", ctypes.c_char * 64),
                ("error", ctypes.c_int32), ("problem", ctypes.c_char * 256)]

seen = {}

@ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(Info))
def found(user, info):
    assert info.contents.struct_size >= ctypes.sizeof(Info)
    seen.setdefault(info.contents.driver.decode(), []).append(info.contents.name.decode())
    return 0

assert library.fathom_sources_enumerate(None, found, None, None, None) >= 0
assert sorted(seen) == ["folder", "hid", "iio", "openni2", "udp", "usb"], seen
assert seen["folder"] == ["recording folders"]
print(seen)
END
check "Python loads it by ctypes and lists the sources" "$out"

echo "1..$number"
[ "$failed" -eq 0 ]
