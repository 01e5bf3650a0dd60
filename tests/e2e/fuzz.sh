#!/bin/sh
# Each fuzzer for a few seconds: tests/e2e/fuzz.sh BUILD. FUZZ_CHECK_SECONDS sets how many; make fuzz runs them for long.
exec sh "$(dirname "$0")/../fuzz/run.sh" "$1" "${FUZZ_CHECK_SECONDS:-4}"
