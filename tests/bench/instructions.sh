#!/bin/sh
# Counts the instructions of a short replay by stage, a figure that other work on the machine can't move:
# sh tests/bench/instructions.sh BUILD [--update|--check]. Prints a count a stage; --update makes them the record of this
# toolchain in tests/bench/instructions.txt; --check compares with the record and prints TAP.
# A small simulated room is replayed by valgrind's callgrind on PoCL's basic device, which runs kernels in the calling
# thread. Kernels are compiled for one CPU whatever this one is: valgrind knows no AVX-512, and counts depend on the width
# of vectors. A first replay without valgrind compiles them for the same width (vector_width.c) and leaves them in the
# caches in BUILD/instructions: compiling them under valgrind takes minutes.
set -u

[ $# -ge 1 ] || { echo "usage: sh tests/bench/instructions.sh BUILD [--update|--check]" >&2; exit 2; }
build=$(cd "$1" 2>/dev/null && pwd) || { echo "instructions: $1: no such build folder" >&2; exit 2; }
mode=${2:-}
here=$(cd "$(dirname "$0")" && pwd)
work=$build/instructions

absent() {
    if [ "$mode" = --check ]; then echo "ok 1 - instruction counts # SKIP $*"; exit 0; fi
    echo "instructions: $*" >&2
    exit 1
}

quietly() { # COMMAND...: its output goes to a log, which is shown when it fails
    "$@" >"$work/log" 2>&1 && return 0
    status=$?
    echo "instructions: $1 ended with status $status" >&2
    tail -n 20 "$work/log" >&2
    if [ "$mode" = --check ]; then echo "not ok 1 - instruction counts: the replay failed"; fi
    exit 1
}

[ -x "$build/fathom" ] || absent "$build/fathom isn't built"
[ "$(uname -m)" = x86_64 ] || absent "the CPU that kernels are compiled for is an x86-64 one"
command -v valgrind >/dev/null || absent "no valgrind"
command -v python3 >/dev/null || absent "no python3"
command -v "${CC:-cc}" >/dev/null || absent "no C compiler"
grep -qw avx2 /proc/cpuinfo || absent "this CPU has no AVX2"

mkdir -p "$work/pocl" "$work/cache"
export POCL_DEVICES=basic POCL_LLVM_CPU_NAME=haswell POCL_KERNELLIB_NAME=avx2
export POCL_CACHE_DIR="$work/pocl" XDG_CACHE_HOME="$work/cache"
"$build/fathom" info >"$work/info" 2>&1
grep -q 'basic-haswell' "$work/info" || absent "no PoCL here whose basic device takes POCL_LLVM_CPU_NAME"
# what counts depend on beside the source
pocl=$(sed -n 's/.*\(PoCL [0-9.]*\).*/\1/p' "$work/info" | head -n 1)
llvm=$(sed -n 's/.*\(LLVM [0-9.]*\).*/\1/p' "$work/info" | head -n 1)
compiler=$(strings -a "$build/fathom" 2>/dev/null | sed -n 's/^GCC: .* \([0-9.]*\)$/GCC \1/p' | head -n 1)
toolchain="$pocl, ${llvm:-LLVM}, ${compiler:-another compiler}, haswell"

quietly "$build/fathom" simulate room "$work/room" --frames 14 --size 160x120 --still 0 --speed 2 --threads 1 --force
quietly "${CC:-cc}" -std=c11 -D_GNU_SOURCE -O1 -shared -fPIC -o "$work/vector_width.so" "$here/vector_width.c" -ldl
# five blank frames: after them alignment starts at the coarsest level, and the verdict looks at the surface
set -- "$build/fathom" replay "$work/room" --size 80x60 --voxel 0.02 --memory 32 --outage 4:9
quietly env LD_PRELOAD="$work/vector_width.so" "$@"
built() { find "$work/pocl" -name '*.so' | sort; }
built >"$work/built"
quietly valgrind --tool=callgrind --callgrind-out-file="$work/callgrind" --toggle-collect=fathom_step "$@"
built | cmp -s - "$work/built" || echo "# kernels were compiled while they were counted, which takes minutes"
PYTHONDONTWRITEBYTECODE=1 exec python3 "$here/instructions.py" "$work/callgrind" "$here/instructions.txt" "$toolchain" $mode
