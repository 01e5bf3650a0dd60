# For the scripts of tests/e2e that run the command, to be sourced: TAP (tap.sh), the command's place, a folder to work in.
# Sets $build, $fathom, $root (of the project), $data (recordings beside it), $work (the present folder, gone at the end).
. "$(dirname "$0")/../support/tap.sh"
build=$(cd "${1:?usage: sh $0 BUILD_DIR}" && pwd) || exit 1
fathom=$build/fathom
[ -x "$fathom" ] || { echo "Bail out! $fathom isn't built"; exit 1; }
root=$(cd "$(dirname "$0")/../.." && pwd)
data=$root/../shared/data
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-$(basename "$0" .sh)-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
cd "$work" || exit 1

# own_caches: what is built once stays in the folder.
own_caches() {
    export XDG_CACHE_HOME="$work/cache" POCL_CACHE_DIR="$work/cache/pocl"
    mkdir -p "$work/cache/pocl"
}

# run COMMAND...: into out, err and $status.
run() {
    "$@" >out 2>err
    status=$?
}

lines() { wc -l <"$1" | tr -d ' '; }

# figure NAME: of the last line of out.
figure() { tail -n 1 out | tr ' ' '\n' | sed -n "s/^$1=//p"; }

# One line on stderr that is no note and no warning, or one that is a warning, and it holds the words.
one_error() { [ "$(grep -c -v -e '^fathom: note: ' -e '^fathom: warning: ' err)" -eq 1 ] && grep -q -e "$1" err; }
one_warning() { [ "$(grep -c '^fathom: warning: ' err)" -eq 1 ] && grep '^fathom: warning: ' err | grep -q -e "$1"; }

# Whole: the size that the header's counts ask for.
whole_ply() {
    [ -s "$1" ] || return 1
    vertices=$(head -c 1000 "$1" | sed -n 's/^element vertex //p')
    faces=$(head -c 1000 "$1" | sed -n 's/^element face //p')
    header=$(LC_ALL=C awk '{ n += length($0) + 1 } /^end_header/ { print n; exit }' "$1")
    [ "$(($(wc -c <"$1")))" -eq $((header + 24 * vertices + 13 * faces)) ] && [ "$faces" -gt 0 ]
}
