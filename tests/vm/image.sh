#!/bin/sh
# The machine's memory disk: busybox, udevd, kernel modules and the test program with its libraries:
# tests/vm/image.sh KERNEL-FOLDER PROGRAM IMAGE
set -eu
kernel=$1 program=$2 image=$3
here=$(cd "$(dirname "$0")" && pwd)
PATH=$PATH:/sbin:/usr/sbin
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
chmod 755 "$root"
version=$(ls "$kernel/lib/modules")
modules=lib/modules/$version

mkdir -p "$root/bin" "$root/dev" "$root/proc" "$root/sys" "$root/tmp" "$root/run" "$root/etc/udev/rules.d" "$root/lib/udev" \
    "$root/$modules" "$root/extra"
cp "$(command -v busybox)" "$root/bin/busybox"
for name in sh mount; do ln -s busybox "$root/bin/$name"; done
cp "$here/init" "$root/init"
cp "$here/load-sensor-hub" "$root/bin/load-sensor-hub"
chmod 755 "$root/init" "$root/bin/load-sensor-hub"
cp "$here/../../drivers/udev/60-fathom-imu.rules" "$root/etc/udev/rules.d/"
printf 'root:x:0:0::/:/bin/sh\nuser:x:1000:1000::/:/bin/sh\n' >"$root/etc/passwd"
printf 'root:x:0:\nvideo:x:44:\nuser:x:1000:\n' >"$root/etc/group"

# Modules with what they need; those of the sensor hub apart, or udev would load them at once.
[ -f "$kernel/$modules/modules.dep" ] || depmod -b "$kernel" "$version"
needed() {
    for module in "$@"; do
        modprobe -d "$kernel" -S "$version" --show-depends "$module" 2>/dev/null || true
    done | sed -n 's/^insmod \([^ ]*\).*/\1/p' | awk '!seen[$0]++'
}
unpack() { # FILE FOLDER
    cp "$1" "$2/"
    case $1 in *.xz) xz -d "$2/$(basename "$1")" ;; esac
}
needed hidraw uhid hid-generic hid-playstation usbhid vhci-hcd | while read -r file; do
    folder=$root/$modules/$(dirname "${file#*"$modules"/}")
    mkdir -p "$folder"
    unpack "$file" "$folder"
done
cp "$kernel/$modules/modules.builtin" "$kernel/$modules/modules.order" "$root/$modules/"
depmod -b "$root" "$version"
needed hid-sensor-hub hid-sensor-accel-3d hid-sensor-gyro-3d | while read -r file; do
    base=$(basename "$file" .xz)
    find "$root/$modules" -name "$base" | grep -q . && continue
    unpack "$file" "$root/extra"
    echo "$base" >>"$root/extra/order"
done

udevd=$kernel/bin/udevadm
[ -f "$udevd" ] || udevd=$kernel/usr/bin/udevadm
cp "$udevd" "$root/bin/systemd-udevd"
ln -s systemd-udevd "$root/bin/udevadm"
cp "$program" "$root/bin/vm_drivers"
for file in "$root/bin/systemd-udevd" "$root/bin/vm_drivers"; do
    ldd "$file" | sed -n 's/.* => \(\/[^ ]*\).*/\1/p; s/^[[:space:]]*\(\/lib[^ ]*ld-linux[^ ]*\).*/\1/p'
done | sort -u | while read -r library; do
    mkdir -p "$root$(dirname "$library")"
    cp -L "$library" "$root$library"
done
(cd "$root" && find . | cpio -o -H newc -R 0:0 --quiet) | gzip -1 >"$image"
