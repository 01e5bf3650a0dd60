#!/bin/sh
# The headers by themselves, the shared library's surface, the installed package from outside, the README's program:
# tests/e2e/headers.sh BUILD. Prints TAP.
set -u
build=$1
cd "$(dirname "$0")/../.." || exit 1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
log=$work/log
cc=${CC:-cc}
cxx=${CXX:-c++}
strict="-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror -fsyntax-only"
number=0

# check NAME COMMAND...: one TAP line
check() {
    name=$1
    shift
    number=$((number + 1))
    if "$@" >"$log" 2>&1; then
        echo "ok $number - $name"
    else
        echo "not ok $number - $name"
        cat "$log" >&2
    fi
}
skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}

# ---- each header alone, twice over
for header in lib/fathom.h drivers/fathom_drivers.h; do
    base=$(basename "$header")
    printf '#include "%s"\n#include "%s"\nint used_%s;\n' "$base" "$base" "$(echo "$base" | tr . _)" >"$work/alone.c"
    cp "$work/alone.c" "$work/alone.cpp"
    check "$base alone as C11" $cc -std=c11 $strict -Ilib -Idrivers "$work/alone.c"
    check "$base alone as C++11" $cxx -std=c++11 $strict -Ilib -Idrivers "$work/alone.cpp"
    check "$base alone as C++20" $cxx -std=c++20 $strict -Ilib -Idrivers "$work/alone.cpp"
done

# ---- the shared library
so=$build/libfathom.so
only_ours() {
    nm -D --defined-only "$so" | awk '{print $NF}' | sort >"$work/exported"
    ! grep -v '^fathom_' "$work/exported" && [ -s "$work/exported" ]
}
all_declared() { # every function that the header declares is exported, and no other
    sed -n 's/^FATHOM_API.*[ *]\(fathom_[a-z_0-9]*\)(.*/\1/p' lib/fathom.h | sort >"$work/declared"
    [ "$(wc -l <"$work/declared")" -ge 15 ] && diff "$work/declared" "$work/exported"
}
soname() { readelf -d "$so" | grep -q 'SONAME.*\[libfathom\.so\.0\.2\]'; }
if command -v nm >/dev/null; then
    check "exports nothing but fathom_*" only_ours
    check "exports what the header declares" all_declared
else
    skip "exports nothing but fathom_*" "nm is missing"
    skip "exports what the header declares" "nm is missing"
fi
if command -v readelf >/dev/null; then
    check "soname is libfathom.so.0.2" soname
else
    skip "soname is libfathom.so.0.2" "readelf is missing"
fi

# ---- the package, installed somewhere and used from outside
root=$work/root
usr=$root/usr
install_it() { make BUILD="$build" PREFIX=/usr DESTDIR="$root" install; }
check "make install with PREFIX and DESTDIR" install_it
PKG_CONFIG_PATH=$usr/lib/pkgconfig
PKG_CONFIG_SYSROOT_DIR=$root
PKG_CONFIG_ALLOW_SYSTEM_CFLAGS=1
PKG_CONFIG_ALLOW_SYSTEM_LIBS=1
export PKG_CONFIG_PATH PKG_CONFIG_SYSROOT_DIR PKG_CONFIG_ALLOW_SYSTEM_CFLAGS PKG_CONFIG_ALLOW_SYSTEM_LIBS
cat >"$work/outside.c" <<'END'
#include <fathom.h>
#include <stdio.h>
#include <string.h>
int main(void) {
    char header[32];
    snprintf(header, sizeof header, "%d.%d.%d", FATHOM_VERSION_MAJOR, FATHOM_VERSION_MINOR, FATHOM_VERSION_PATCH);
    fathom_config config;
    fathom_config_init(&config);
    long long bytes = (long long)fathom_memory_required(&config, NULL, 0);
    printf("%s %lld\n", fathom_version(), bytes);
    return strcmp(header, fathom_version()) != 0 || bytes <= 0;
}
END
cp "$work/outside.c" "$work/outside.cpp"
cd "$work" || exit 1 # nothing of the source tree is in reach
shared() { $1 -o "$work/shared" "$2" $(pkg-config --cflags --libs fathom) && LD_LIBRARY_PATH=$usr/lib "$work/shared"; }
needed() { readelf -d "$work/shared" | grep 'NEEDED.*\[libfathom\.so\.0\.2\]'; }
# the system's own libraries (OpenCL) aren't in the sysroot
static() {
    $cc -o "$work/static" outside.c $(pkg-config --cflags fathom) "$usr/lib/libfathom.a" -lOpenCL -lstdc++ -lpthread -lm &&
        "$work/static"
}
cat >"$work/drivers.c" <<'END'
#include <fathom_drivers.h>
int main(void) {
    fathom_source *source;
    return fathom_source_open(&source, "folder:/nowhere", 0) != FATHOM_ERROR_NO_DATA;
}
END
drivers() {
    $cc -o "$work/drivers" drivers.c $(pkg-config --cflags --libs fathom-drivers) && LD_LIBRARY_PATH=$usr/lib "$work/drivers"
}
version() { [ "$(pkg-config --modversion fathom)" = "$("$work/shared" 2>/dev/null | cut -d' ' -f1)" ]; }
check "a C program outside, by pkg-config" shared "$cc" outside.c
if command -v readelf >/dev/null; then check "it needs libfathom.so.0.2" needed; else skip "it needs libfathom.so.0.2" "no readelf"; fi
LD_LIBRARY_PATH=$usr/lib
export LD_LIBRARY_PATH
check "pkg-config has the library's version" version
check "a program with the drivers, by pkg-config" drivers
check "a C++ program outside" shared "$cxx" outside.cpp
unset LD_LIBRARY_PATH
check "a program with the static library" static
check "the installed command" "$usr/bin/fathom" --version
shared_files() { [ -s "$usr/share/man/man1/fathom.1" ] && grep -q '^complete -F' "$usr/share/bash-completion/completions/fathom"; }
check "the manual page and completion are installed" shared_files
cd - >/dev/null || exit 1
uninstall_it() { make BUILD="$build" PREFIX=/usr DESTDIR="$root" uninstall; }

# ---- the README's program
readme_is_example() {
    awk '/^```c$/ && !done { inside = 1; next } /^```/ { if (inside) done = 1; inside = 0 } inside' README.md >"$work/readme.c" &&
        diff examples/minimal.c "$work/readme.c"
}
# Two frames of a room's corner, the second from 1 cm further in.
corner() {
    python3 -c '
import struct, sys
for z in (0, 0.01):
    rows = []
    for y in range(480):
        for x in range(640):
            u, v, d = (x - 319.5) / 525, (y - 239.5) / 525, 1.5 - z
            d = 0.4 / u if u * d > 0.4 else d
            d = 0.3 / v if v * d > 0.3 else d
            rows.append(int(1000 * d + 0.5))
    sys.stdout.buffer.write(struct.pack("<307200H", *rows))' >"$work/corner.raw"
}
minimal() { corner && [ "$("$build/minimal" <"$work/corner.raw" | cut -d: -f1 | tr '\n' ' ')" = "first tracked " ]; }
readme_program() {
    [ -s "$work/readme.c" ] &&
        $cc -std=c11 -Wall -Wextra -Werror -o "$work/readme" "$work/readme.c" $(pkg-config --cflags --libs fathom) -lm &&
        LD_LIBRARY_PATH=$usr/lib "$work/readme" <"$work/corner.raw"
}
if [ -f README.md ] && grep -q '^```c$' README.md; then
    check "the README's program is examples/minimal.c" readme_is_example
    check "examples/minimal.c tracks its second frame" minimal
    check "the README's program compiles and runs outside" readme_program
else
    skip "the README's program" "there is none"
fi

check "make uninstall" uninstall_it
left() { find "$root" ! -type d | grep . && return 1 || return 0; }
check "it leaves nothing behind" left
echo "1..$number"
