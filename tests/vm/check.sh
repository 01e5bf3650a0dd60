#!/bin/sh
# The drivers in a virtual machine with Debian's stock kernel: tests/vm/check.sh BUILD. Prints TAP; without what it takes, or
# where no machine runs, it says so and is skipped. No root, no KVM needed. VM_TIMEOUT: seconds for all of it. VM_TESTS: only
# those whose names match (* and ?).
set -u
build=$1
cd "$(dirname "$0")/../.." || exit 1
PATH=$PATH:/sbin:/usr/sbin
work=$build/vm
program=$build/tests/vm/vm_drivers
mkdir -p "$work"

skip() {
    echo "1..1"
    echo "ok 1 - drivers in a virtual machine # SKIP $1"
    exit 0
}
for tool in qemu-system-x86_64 busybox cpio depmod modprobe xz ldd dpkg-deb; do
    command -v $tool >/dev/null || skip "$tool is missing (Debian: qemu-system-x86 busybox-static cpio kmod xz-utils)"
done
[ "$(uname -m)" = x86_64 ] || skip "the machine is for x86-64"
[ -x "$program" ] || skip "$program isn't built (hidapi, libusb and libiio are needed)"
sh tests/vm/kernel.sh "$work/kernel" >"$work/kernel.log" 2>&1 || skip "the kernel's package can't be fetched (see $work/kernel.log)"
if ! sh tests/vm/image.sh "$work/kernel" "$program" "$work/image.gz" >"$work/image.log" 2>&1; then
    tail -n 20 "$work/image.log" | sed 's/^/# /'
    echo "1..1"
    echo "not ok 1 - the machine's image can't be made"
    exit 1
fi

# /dev/kvm alone proves nothing: the processor must say that it can. With emulation one processor is faster than two.
if [ "${VM_KVM:-auto}" != 0 ] && [ -w /dev/kvm ] && grep -qwE 'vmx|svm' /proc/cpuinfo; then
    how="-accel kvm -cpu host -smp 2"
else
    how="-accel tcg -cpu max -smp 1"
fi
# shellcheck disable=SC2086
timeout "${VM_TIMEOUT:-600}" qemu-system-x86_64 $how -m "${VM_MEMORY:-512}" -nodefaults -no-user-config -display none -serial stdio -no-reboot \
    -kernel "$(ls "$work"/kernel/boot/vmlinuz-*)" -initrd "$work/image.gz" \
    -append "console=ttyS0 quiet loglevel=3 panic=-1 mitigations=off random.trust_cpu=on nokaslr tsc=reliable vm_tests=${VM_TESTS:-*}" \
    </dev/null >"$work/console.log" 2>"$work/qemu.log"
tr -d '\r' <"$work/console.log" >"$work/console.txt"
grep -q '^VM-BEGIN' "$work/console.txt" || skip "no virtual machine runs here (see $work/qemu.log, $work/console.log)"
sed -n '/^VM-BEGIN/,/^VM-END/p' "$work/console.txt" | grep -v '^VM-'
status=$(sed -n 's/^VM-END \([0-9]*\).*/\1/p' "$work/console.txt")
if [ -z "$status" ]; then
    echo "not ok - the tests didn't come to their end"
    exit 1
fi
[ "$status" = 0 ] || sed -n '/^VM-END/,$p' "$work/console.txt" | grep '^#'
[ "$status" = 0 ]
