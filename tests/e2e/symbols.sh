#!/bin/sh
# Nothing but fathom_* leaves the archives and the shared objects, so that a caller's own step() or align() is neither
# taken for the library's nor in its way. Usage: sh tests/e2e/symbols.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"

build=$(cd "${1:?usage: sh tests/e2e/symbols.sh BUILD_DIR}" && pwd) || exit 1
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-symbols-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
cd "$work" || exit 1
cc=${CC:-cc}

if ! command -v nm >/dev/null; then
    echo "ok 1 - symbols # SKIP no nm"
    exit 0
fi

# foreign KIND FILE: the names that a file lets out and that aren't fathom_*, weak and unique ones among them; a name that
# another object could bind to is in no local letter.
foreign() {
    case $1 in
    archive) nm --defined-only "$2" ;;
    shared) nm -D --defined-only "$2" ;;
    esac | awk 'NF == 3 && ($2 ~ /[A-Z]/ || $2 == "u" || $2 == "v" || $2 == "w") && $3 !~ /^fathom_/' >out
    cat out >err
    [ ! -s out ]
}
has() { nm "$@" --defined-only | grep -q ' T fathom_'; }

for file in "$build"/libfathom*.a; do
    has "$file" && foreign archive "$file"
    check "$(basename "$file") lets out nothing but fathom_*"
done
for file in "$build"/libfathom*.so; do
    has -D "$file" && foreign shared "$file"
    check "$(basename "$file") lets out nothing but fathom_*"
done

# A caller with functions of these names: every one that a source of the library defines without being static, and some
# that once were.
{
    printf '%s\n' step align fuse attempt judge judge_view pose_identity pose_exp pose_log pose_multiply pose_between
    for object in $(find "$build/lib" -name '*.o'); do
        nm --defined-only "$object" 2>/dev/null | awk '$2 == "T" && $3 !~ /^(fathom_|_)/ { print $3 }'
    done
} | sort -u >names
[ "$(wc -l <names)" -gt 60 ]
check "the library's inside has names to be hidden ($(wc -l <names))" names

sed 's/.*/int &(void); int &(void) { return 1; }/' names >names.c
$cc -std=c11 -w -fno-builtin -I"$root/lib" -o caller names.c "$root/tests/e2e/programs/small_scan.c" "$build/libfathom.a" \
    -lOpenCL -lstdc++ -lpthread -lm >out 2>err
check "a program that defines them links with libfathom.a"
./caller 64 48 ss >out 2>err && grep -q "^first fused, tracked fused" out
check "its steps are the library's: the second frame is tracked and fused"
$cc -std=c11 -w -fno-builtin -I"$root/lib" -o shared names.c "$root/tests/e2e/programs/small_scan.c" -L"$build" -lfathom \
    -Wl,-rpath,"$build" -rdynamic >out 2>err && ./shared 64 48 ss >out 2>err && grep -q "^first fused, tracked fused" out
check "the same with libfathom.so, from a program that lets its own names out"

echo "1..$number"
[ $failed -eq 0 ]
