#!/bin/sh
# Debian's stock kernel and udev, unpacked into a folder and never installed: tests/vm/kernel.sh FOLDER. What is there already
# stays. VM_KERNEL names another kernel package.
set -eu
folder=$1
[ ! -f "$folder/done" ] || exit 0
package=${VM_KERNEL:-$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: \(linux-image-[0-9].*\)/\1/p' | head -n 1)}
[ -n "$package" ]
mkdir -p "$folder"
cd "$folder"
sandbox=
[ "$(id -u)" != 0 ] || sandbox="-o APT::Sandbox::User=root"
# shellcheck disable=SC2086
apt-get -q $sandbox download "$package" udev
for deb in linux-image-*.deb udev_*.deb; do dpkg-deb -x "$deb" .; done
rm -f ./*.deb
touch done
