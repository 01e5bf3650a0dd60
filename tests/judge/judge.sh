#!/bin/sh
# Judges a build over many recordings: sh tests/judge/judge.sh BUILD [options]
# Options are judge.py's (--help lists them). Debian's python3-numpy belongs to Debian's own Python, which need not be the first
# in PATH.
set -u

[ $# -ge 1 ] || { echo "usage: sh tests/judge/judge.sh BUILD [options]" >&2; exit 2; }
for python in python3 /usr/bin/python3; do
    if "$python" -c 'import numpy' 2>/dev/null; then
        PYTHONDONTWRITEBYTECODE=1 exec "$python" "$(dirname "$0")/judge.py" "$@"
    fi
done
echo "judge: no Python here has numpy; run make deps" >&2
exit 1
