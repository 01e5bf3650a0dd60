#!/bin/sh
# The paper's claims as experiments: sh tests/reproduce/reproduce.sh BUILD [options]. Writes docs/RESULTS.md and its figures.
# Options are reproduce.py's (--help lists them). Debian's python3-numpy and python3-matplotlib belong to Debian's own Python,
# which need not be the first in PATH.
set -u

[ $# -ge 1 ] || { echo "usage: sh tests/reproduce/reproduce.sh BUILD [options]" >&2; exit 2; }
build=$1
shift
for python in python3 /usr/bin/python3; do
    if "$python" -c 'import numpy, matplotlib' 2>/dev/null; then
        PYTHONDONTWRITEBYTECODE=1 exec "$python" "$(dirname "$0")/reproduce.py" --build "$build" "$@"
    fi
done
echo "reproduce: no Python here has numpy and matplotlib; run make deps" >&2
exit 1
