#!/bin/sh
# The kernel checks on a second OpenCL implementation: Intel's runtime for CPUs, from PyPI, in an environment under
# BUILD_DIR that is made once. Usage: sh tests/e2e/second_platform.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u

build=${1:?usage: sh tests/e2e/second_platform.sh BUILD_DIR}
build=$(cd "$build" && pwd) || exit 1
venv=$build/second-platform
text="kernels on a second OpenCL platform"

skip() {
    echo "ok 1 - $text # SKIP $1"
    exit 0
}

if [ ! -e "$venv/complete" ]; then
    case $(uname -m) in x86_64) ;; *) skip "the runtime exists for x86-64 only" ;; esac
    command -v python3 >/dev/null 2>&1 || skip "no python3"
    rm -rf "$venv"
    log=$build/second-platform.log
    python3 -m venv "$venv" >"$log" 2>&1 || skip "no environment can be made: $(tail -n 1 "$log")"
    timeout 300 "$venv/bin/pip" --disable-pip-version-check --retries 2 --timeout 20 install intel-opencl-rt intel-cmplr-lib-rt >>"$log" 2>&1 ||
        skip "the runtime can't be installed: $(grep -i error "$log" | tail -n 1)"
    : >"$venv/complete"
fi

library=$(ls "$venv"/lib/libintelocl.so.* 2>/dev/null | head -n 1)
[ -n "$library" ] || skip "the package holds no libintelocl.so"
mkdir -p "$venv/vendors"
echo "$library" >"$venv/vendors/intel.icd"

# The runtime sets its own environment up from beside the library; the rest of the machine's platforms stay out.
OCL_ICD_VENDORS="$venv/vendors" LD_LIBRARY_PATH="$venv/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" \
    XDG_CACHE_HOME="$venv/cache" CMOCKA_MESSAGE_OUTPUT=TAP "$build/tests/test_kernels" >"$venv/out" 2>"$venv/err"
status=$?
cat "$venv/out"
sed 's/^/# /' "$venv/err"
exit $status
