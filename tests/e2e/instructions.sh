#!/bin/sh
# Instructions of each stage over a short replay, against the record in tests/bench/instructions.txt, which make
# instructions writes. Usage: sh tests/e2e/instructions.sh BUILD_DIR. Prints TAP; exits 1 when a stage has grown by more
# than a tenth. Skipped where there is no valgrind or no record for the toolchain.
exec sh "$(dirname "$0")/../bench/instructions.sh" "${1:?usage: sh tests/e2e/instructions.sh BUILD_DIR}" --check
