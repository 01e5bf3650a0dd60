#!/bin/sh
# A scan's outcome doesn't depend on the number of threads: poses, figures, blocks and mesh are the same to the last bit.
# Usage: sh tests/e2e/determinism.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"

# replay NAME THREADS OPTIONS...: into NAME.txt, NAME.csv (without the times) and NAME.ply.
replay() {
    name=$1
    threads=$2
    shift 2
    POCL_MAX_PTHREAD_COUNT=$threads "$fathom" replay recording "$@" --trajectory "$name.txt" --stats all.csv \
        --mesh "$name.ply" >"$name.out" 2>err || return 1
    cut -d, -f1-10 all.csv >"$name.csv"
    sed 's/ms_[a-z0-9]*=[^ ]* *//g' "$name.out" | tail -n 1 >"$name.sum"
}

same() { cmp "$1.txt" "$2.txt" && cmp "$1.csv" "$2.csv" && cmp "$1.ply" "$2.ply" && cmp "$1.sum" "$2.sum"; }

"$fathom" simulate desk recording --frames 12 --size 320x240 --still 0 >err 2>&1
check "a recording"

for against in model previous; do
    replay one 1 --against $against && replay two 2 --against $against && replay again 2 --against $against
    check "against $against: replayed with one thread and with two"
    [ -s one.ply ] && [ "$(wc -l <one.txt)" -eq 12 ] && same one two >>err 2>&1
    check "against $against: one thread or two, the same trajectory, figures and mesh to the last bit"
    same two again >>err 2>&1
    check "against $against: twice the same"
    (POCL_DEVICES=basic && export POCL_DEVICES && replay basic 1 --against $against) && same two basic >>err 2>&1
    check "against $against: PoCL's device without threads, the same to the last bit"
done

[ $failed -eq 0 ]
