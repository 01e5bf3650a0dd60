#!/bin/sh
# The house's floors (docs/DESIGN.md), from the include lines: a part of lib/ stands only on those below it, drivers meet
# the library only through fathom.h, examples use the public headers. And no source file is longer than 400 lines.
# Usage: sh tests/e2e/floors.sh [BUILD_DIR]. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/tap.sh"
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-floors-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
cd "$(dirname "$0")/../.." || exit 1

# Floors of lib/, lowest first; what stands on the same line doesn't know of each other.
cat >"$work/floors" <<'END'
base
cl
frame map/blocks
align inertial map
tracking selftest
context
step
api
END

# file:included for every #include "..." of the sources; included as a path from the root of the project.
find lib drivers examples opencl -name '*.[ch]' -o -name '*.cpp' -o -name '*.cl' | sort >"$work/sources"
while read -r file; do
    sed -n 's/^ *# *include *"\([^"]*\)".*/\1/p' "$file" | while read -r name; do
        for root in lib drivers examples tests tests/support . "$(dirname "$file")"; do
            [ -e "$root/$name" ] && echo "$file:${root#./}/$name" && continue 2
        done
        echo "$file:?/$name"
    done
done <"$work/sources" | sed 's|:\./|:|' >"$work/includes"
[ "$(wc -l <"$work/includes")" -gt 100 ]
check "include lines are found ($(wc -l <"$work/includes"))" "$work/includes"

! grep ':?/' "$work/includes" >"$work/bad"
check "every include names a file by its path from lib/, drivers/ or examples/" "$work/bad"

# A file's part is the longest name in the list of floors that its path begins with.
awk -F: '
    function part(path,   p, best) {
        sub(/^lib\//, "", path)
        for (p in floor) if (index(path, p) == 1 && substr(path, length(p) + 1, 1) ~ /[\/.]/ && length(p) > length(best)) best = p
        return best
    }
    FILENAME ~ /floors$/ { n = split($0, names, " "); for (i = 1; i <= n; i++) floor[names[i]] = FNR; next }
    $1 !~ /^lib\// || $2 !~ /^lib\// || $2 == "lib/fathom.h" { next }
    {
        from = part($1); to = part($2)
        if (from == "" || to == "") print $1 " includes " $2 ": on no floor"
        else if (from != to && floor[to] >= floor[from]) print $1 " includes " $2
    }' "$work/floors" "$work/includes" >"$work/bad"
[ ! -s "$work/bad" ]
check "lib/: each part stands only on those below it" "$work/bad"

! grep -E '^lib/.*:(drivers|examples|tests)/' "$work/includes" >"$work/bad"
check "lib/ includes nothing of drivers, examples or tests" "$work/bad"

! grep -E '^drivers/.*:(lib|examples|tests)/' "$work/includes" | grep -vE ':lib/(fathom|base/sized)\.h$' >"$work/bad"
check "drivers/ knows the library by fathom.h and base/sized.h, which needs no library, alone" "$work/bad"

! grep -E '^examples/.*:(lib|drivers|tests)/' "$work/includes" | grep -vE ':(lib/fathom|drivers/fathom_drivers)\.h$' >"$work/bad"
check "examples/ uses the public headers alone" "$work/bad"

while read -r file; do
    lines=$(wc -l <"$file")
    case $file in lib/fathom.h | drivers/fathom_drivers.h) continue ;; esac
    [ "$lines" -le 400 ] || echo "$file: $lines lines"
done <"$work/sources" >"$work/bad"
[ ! -s "$work/bad" ]
check "no source file is longer than 400 lines" "$work/bad"

lines=$(wc -l <lib/step.c)
[ "$lines" -le 120 ]
check "lib/step.c is at most 120 lines: Figure 2, and nothing else ($lines)" /dev/null

echo "1..$number"
[ $failed -eq 0 ]
