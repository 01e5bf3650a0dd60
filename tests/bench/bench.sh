#!/bin/sh
# Times fathom beside Open3D (dense SLAM; fusion alone) and OpenCV (odometry alone) on the same frames in the same run, and
# its kernels beside the machine's limit: sh tests/bench/bench.sh BUILD [options]
# Options are bench.py's (--quick, --pairs N, --frames N, --minutes N ...; --help lists them). The tables go to stdout, all
# figures to out/bench.json, and with --results into docs/SPEED.md. It is not a test: however slow, it exits 0; 1 only when
# nothing could be measured.
# Open3D lives in a Python environment of its own, BUILD/bench-venv, made once. Where it can't be had, the reason is
# said and fathom is timed without it. OpenCV's program is built by make where its rgbd module is installed.
set -u

[ $# -ge 1 ] || { echo "usage: sh tests/bench/bench.sh BUILD [options]" >&2; exit 2; }
build=$(cd "$1" 2>/dev/null && pwd) || { echo "bench: $1: no such build folder; run make first" >&2; exit 2; }
shift
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/../.." || exit 1
[ -x "$build/fathom" ] && [ -x "$build/tests/bench/limit" ] ||
    { echo "bench: $build/fathom or $build/tests/bench/limit isn't built; run make programs bench-tools" >&2; exit 2; }
[ -x "$build/tests/bench/odometry" ] || echo "bench: no OpenCV with its rgbd module: FastICPOdometry is left out" >&2
command -v python3 >/dev/null || { echo "bench: python3 is missing; run make deps" >&2; exit 1; }

venv=$build/bench-venv
log=$build/bench-venv.log
libraries="libusb-1.0-0 libgl1 libgomp1 libx11-6" # what Open3D's wheel loads and a bare Debian may lack

without() { echo "bench: $*: Open3D is left out" >&2; }

loads() { "$venv/bin/python" -c 'import open3d' >>"$log" 2>&1; }

install_libraries() {
    if [ "$(id -u)" = 0 ]; then as=""
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then as=sudo
    else return 1; fi
    command -v apt-get >/dev/null || return 1
    echo "bench: installing $libraries for Open3D" >&2
    # shellcheck disable=SC2086
    { $as apt-get update -q &&
        $as env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $libraries; } >>"$log" 2>&1
}

# A finished environment has a mark, so that one whose making was broken off is made anew.
make_venv() {
    [ -e "$venv/ready" ] && return 0
    echo "bench: making $venv with Open3D (once; about half a gigabyte)" >&2
    rm -rf "$venv"
    python3 -m venv "$venv" >"$log" 2>&1 || { without "no Python environment (python3-venv? see $log)"; return 1; }
    pip="$venv/bin/python -m pip install -q --disable-pip-version-check --retries 1 --timeout 20"
    # open3d-cpu has wheels for x86-64 only, open3d for 64-bit ARM too
    $pip numpy open3d-cpu >>"$log" 2>&1 || $pip numpy open3d >>"$log" 2>&1 ||
        { without "Open3D can't be installed (see $log)"; return 1; }
    touch "$venv/ready"
}

open3d=""
if make_venv; then
    if loads || { install_libraries && loads; }; then
        open3d=$venv/bin/python
    else
        without "Open3D doesn't load; apt-get install $libraries may help (see $log)"
    fi
fi

PYTHONDONTWRITEBYTECODE=1 exec python3 "$here/bench.py" --build "$build" --open3d "$open3d" "$@"
