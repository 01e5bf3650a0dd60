#!/bin/sh
# make reproduce's machinery: its cheapest section, of short and small recordings, into a folder of its own; the page has the
# section's table, commands and figure. What it measures there says nothing and isn't looked at.
# Usage: sh tests/e2e/reproduce.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u

build=$(cd "${1:?usage: sh tests/e2e/reproduce.sh BUILD_DIR}" && pwd) || exit 1
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../support/tap.sh"
for python in python3 /usr/bin/python3 ''; do
    [ -n "$python" ] && "$python" -c 'import numpy, matplotlib' 2>/dev/null && break
done
if [ -z "$python" ]; then
    echo "ok 1 - make reproduce, a small run # SKIP no Python here has numpy and matplotlib (make deps)"
    exit 0
fi
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-reproduce-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
cd "$work" || exit 1

reproduce() { sh "$here/../reproduce/reproduce.sh" "$build" --results "$work/results" --docs "$work/docs" "$@" >out 2>err; }

reproduce --tiny --sections b
check "section b runs on small recordings"
grep -q '^| simulated wall 1 | .* | fathom, IMU | .* | `fathom replay wall-35-1 --iterations 0,0,3` |$' docs/RESULTS.md
check "the page has a row with its command" docs/RESULTS.md
grep -q '(results/bare-wall.png)' docs/RESULTS.md && [ "$(head -c 4 docs/results/bare-wall.png | tail -c 3)" = PNG ]
check "and the figure" docs/RESULTS.md
grep -q 'Not measured yet: section a, section c' docs/RESULTS.md && grep -q 'shared/data` were not there for section b' docs/RESULTS.md
check "it says what wasn't measured and what was left out" docs/RESULTS.md

cp docs/RESULTS.md first.md
reproduce --sections none && cmp -s first.md docs/RESULTS.md
check "the page can be made again from what was kept"
reproduce --sections b,x
[ $? -eq 2 ]
check "a section that doesn't exist is a wrong usage"
mkdir nothing
sh "$here/../reproduce/reproduce.sh" "$work/nothing" --sections b --results "$work/other" --docs "$work/other" >out 2>err
[ $? -eq 1 ] && ! grep -q Traceback err && [ ! -e other/RESULTS.md ]
check "without a build it fails in words and writes no page"

[ "$failed" -eq 0 ]
