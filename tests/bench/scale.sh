#!/bin/sh
# Time a frame and memory as the work grows: sh tests/bench/scale.sh BUILD [options of scale.py]. Writes docs/SCALE.md.
# Debian's python3-numpy and python3-matplotlib belong to Debian's own Python, which need not be the first in PATH.
set -u

[ $# -ge 1 ] || { echo "usage: sh tests/bench/scale.sh BUILD [options]" >&2; exit 2; }
build=$1
shift
for python in python3 /usr/bin/python3; do
    if "$python" -c 'import numpy, matplotlib' 2>/dev/null; then
        PYTHONDONTWRITEBYTECODE=1 exec "$python" "$(dirname "$0")/scale.py" --build "$build" "$@"
    fi
done
echo "scale: no Python here has numpy and matplotlib; run make deps" >&2
exit 1
