#!/bin/sh
# Installs what the bench's OpenCV program is built with, where that can be done; else says that it is left out.
set -u
package=libopencv-contrib-dev
[ -e /usr/include/opencv4/opencv2/rgbd.hpp ] && exit 0
if [ "$(id -u)" = 0 ]; then as=""
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then as=sudo
else as=none; fi
if [ "$as" = none ] || ! command -v apt-get >/dev/null; then
    echo "bench: $package isn't installed, and can't be from here" >&2
    exit 0
fi
echo "bench: installing $package (once; some 200 packages)" >&2
{ $as apt-get update -q && $as env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $package; } \
    >/dev/null 2>&1 || echo "bench: $package can't be installed" >&2
exit 0
