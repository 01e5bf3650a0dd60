#!/bin/sh
# make judge: its parts against cases whose outcome is known, then its short form: no case worse than tests/judge/recorded.
# Usage: sh tests/e2e/judge.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
# Recordings are made once, in BUILD/judge, and results are kept there: a build that was judged isn't judged again.
set -u

build=${1:?usage: sh tests/e2e/judge.sh BUILD_DIR}
here=$(cd "$(dirname "$0")/../judge" && pwd) || exit 1
for python in python3 /usr/bin/python3 ''; do
    [ -n "$python" ] && "$python" -c 'import numpy' 2>/dev/null && break
done
if [ -z "$python" ]; then
    echo "ok 1 - make judge # SKIP no Python here has numpy (make deps)"
    exit 0
fi
PYTHONDONTWRITEBYTECODE=1 "$python" "$here/check_parts.py"
parts=$?
sh "$here/judge.sh" "$build" --short --tap && [ $parts -eq 0 ]
