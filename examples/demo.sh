#!/bin/sh
# The paper's case in one go: a camera crosses a bare wall, on which depth alone can't tell how far it has moved along.
# The same simulated recording is replayed with its IMU samples and without them. Usage: sh examples/demo.sh BUILD_DIR
# ("make demo"). One table on stdout; meshes, pictures, trajectories and figures of every frame stay in out/demo.
set -eu

fail() {
    echo "demo: $*" >&2
    exit 1
}

[ $# -eq 1 ] || { echo "usage: sh examples/demo.sh BUILD_DIR" >&2; exit 2; }
fathom=$(cd "$1" 2>/dev/null && pwd)/fathom || fail "$1: no such folder; run make first"
[ -x "$fathom" ] || fail "$fathom isn't built; run make first"
cd "$(dirname "$0")/.."
out=out/demo
kitchen=../shared/data/kitchen
mkdir -p "$out" || fail "$out can't be made"
rows=$out/table.part
trap 'rm -f "$rows"' EXIT
trap 'exit 130' INT TERM
: >"$rows" || fail "$out can't be written"

# fathom itself shows progress where stderr is a terminal, and says in one line what is wrong.
say() { echo "demo: $*" >&2; }

# ended STATUS WHAT: goes on only if the command before succeeded.
ended() {
    [ "$1" -ne 130 ] || exit 130
    [ "$1" -eq 0 ] || fail "$2 failed (status $1)"
}

# replay TITLE NAME FOLDER OPTIONS...: leaves NAME.ply, .png, .txt and .csv in out/demo and a row of the table.
replay() {
    title=$1
    name=$2
    folder=$3
    shift 3
    say "replaying: $title"
    status=0
    summary=$("$fathom" replay "$folder" "$@" --mesh "$out/$name.ply" --picture "$out/$name.png" \
        --trajectory "$out/$name.txt" --stats "$out/$name.csv") || status=$?
    ended $status "the replay of $folder"
    printf '%s|%s|%s\n' "$title" "$name" "$(printf '%s\n' "$summary" | tail -n 1)" >>"$rows"
}

say "simulating the bare wall"
status=0
rm -rf "$out/wall"
"$fathom" simulate wall "$out/wall" >/dev/null || status=$?
ended $status "the simulation"
replay "wall, with IMU" wall-imu "$out/wall"
replay "wall, without IMU" wall-no-imu "$out/wall" --imu none
if [ -r "$kitchen/depth.txt" ]; then
    replay "kitchen (a real recording)" kitchen "$kitchen"
fi

awk -F'|' '
    function figure(key,   n, field, i) {
        n = split($3, field, " ")
        for (i = 1; i <= n; i++) if (index(field[i], key "=") == 1) return substr(field[i], length(key) + 2)
        return "-"
    }
    BEGIN { format = "%-28s %6s %7s %8s %5s %8s %8s\n"
            printf format, "run", "frames", "tracked", "reckoned", "lost", "ATE mm", "ms/frame" }
    { ate = figure("ate_rmse_m")
      printf format, $1, figure("frames"), figure("tracked"), figure("reckoned"), figure("lost"),
             ate ~ /^[0-9]/ ? sprintf("%.1f", 1000 * ate) : "-", sprintf("%.1f", figure("ms_median")) }
' "$rows"

echo
echo "ATE: root mean square of the absolute trajectory error over all frames, dead-reckoned ones included."
echo "Left in $out, for each run a mesh (.ply), a picture (.png), the trajectory (.txt) and a line a frame (.csv):"
while IFS='|' read -r title name summary; do
    printf '    %-12s %s/%s.ply  %s/%s.png  .txt  .csv\n' "$name" "$out" "$name" "$out" "$name"
done <"$rows"
echo "    the simulated recording: $out/wall"
