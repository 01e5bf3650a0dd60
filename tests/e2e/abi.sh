#!/bin/sh
# The interface as other builds see it: the list of symbols, and callers built against an older and a later header, run with
# the present library. Usage: sh tests/e2e/abi.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"
build=$(cd "${1:?usage: sh tests/e2e/abi.sh BUILD_DIR}" && pwd) || exit 1
cd "$(dirname "$0")/../.." || exit 1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
out=$work/out
cc=${CC:-cc}

nm -D --defined-only "$build/libfathom.so" | awk '{print $NF}' | LC_ALL=C sort >"$work/exported"
diff tests/abi/libfathom.symbols "$work/exported" >"$out"
check "libfathom.so exports the symbols of tests/abi/libfathom.symbols, and no other" "$out"

# caller NAME FLAGS...: builds tests/abi/caller.c against a header and runs it
caller() {
    name=$1
    shift
    $cc -std=c11 -Wall -Wextra -Werror -Itests/abi "$@" -o "$work/$name" tests/abi/caller.c -L"$build" -lfathom \
        -Wl,-rpath,"$build" >"$out" 2>&1 && "$work/$name" >"$out" 2>&1
}
caller same -Ilib '-DHEADER="fathom.h"'
check "a caller with the library's own header" "$out"
caller older '-DHEADER="fathom_shorter.h"'
check "a caller with an older header, whose structs are shorter and whose settings end before the log" "$out"
caller later '-DHEADER="fathom_longer.h"' -DLONGER
check "a caller with a later header, whose structs are longer" "$out"

echo "1..$number"
[ "$failed" -eq 0 ]
