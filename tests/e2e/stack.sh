#!/bin/sh
# The library's own frames along the deepest path of calls from any public function take at most 64 KB of stack: read from
# the machine code, as pushes, what is taken off the stack pointer, and calls. Calls into other objects (the OpenCL runtime,
# libm) and through pointers (the caller's callbacks) end a path; docs/PORTING.md has what a whole step takes.
# Usage: sh tests/e2e/stack.sh BUILD_DIR. Prints TAP; exits 1 when a case failed. x86-64 only.
set -u
. "$(dirname "$0")/../support/tap.sh"

build=${1:?usage: sh tests/e2e/stack.sh BUILD_DIR}
limit=65536
if [ "$(uname -m)" != x86_64 ] || ! command -v objdump >/dev/null; then
    echo "ok 1 - stack # SKIP no objdump, or not x86-64"
    exit 0
fi
work=$(mktemp -d "${TMPDIR:-/tmp}/fathom-stack-XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM

objdump -d --no-show-raw-insn "$build/libfathom.so" >"$work/code"
awk '
    function hex(text,   i, n) {
        for (i = 1; i <= length(text); i++) n = 16 * n + index("0123456789abcdef", substr(text, i, 1)) - 1
        return n
    }
    # The deepest path from a function, in bytes; next_of leads along it.
    function deepest(f,   n, i, list, depth, best) {
        if (f in total) return total[f]
        if (f in open) { print "recursion: " name[f]; recursive = 1; return 0 }
        open[f] = 1
        n = split(calls[f], list, " ")
        for (i = 1; i <= n; i++)
            if (list[i] in frame && (depth = deepest(list[i])) > best) { best = depth; next_of[f] = list[i] }
        delete open[f]
        return total[f] = frame[f] + best
    }
    /^[0-9a-f]+ <.*>:$/ { at = $1; sub(/^0+/, "", at); name[at] = substr($2, 2, length($2) - 3); start[name[at]] = at; frame[at] = 8; next }
    $2 ~ /^push/ { frame[at] += 8 }
    $2 ~ /^sub/ && $3 ~ /^\$0x[0-9a-f]+,%rsp$/ { split($3, p, /[x,]/); if (length(p[2]) < 9) frame[at] += hex(p[2]) } # longer: less than zero
    $2 ~ /^add/ && $3 ~ /^\$0xf+80,%rsp$/ { frame[at] += 128 }
    $2 ~ /^and/ && $3 ~ /,%rsp$/ { frame[at] += 64 } # alignment
    $2 ~ /^(call|jmp|j[a-z]+)/ && $4 ~ /^<[^+]*>$/ {
        to = $3
        if ($4 ~ /@plt>$/) { to = substr($4, 2, length($4) - 6); to = to in start ? start[to] : "plt:" to }
        if (to != at) calls[at] = calls[at] " " to
    }
    END {
        for (f in calls) { # exported functions are called by their names
            n = split(calls[f], list, " ")
            calls[f] = ""
            for (i = 1; i <= n; i++) {
                to = list[i]
                if (to ~ /^plt:/) { to = substr(to, 5); to = to in start ? start[to] : "" }
                calls[f] = calls[f] " " to
            }
        }
        for (f in frame)
            if (name[f] ~ /^fathom_/ && (depth = deepest(f)) > most) { most = depth; top = f }
        for (f = top; f; f = next_of[f]) printf "%7d of its own, %7d with what it calls: %s\n", frame[f], total[f], name[f]
        print "deepest", most + 0, recursive + 0
    }' "$work/code" >"$work/path"
bytes=$(sed -n 's/^deepest \([0-9]*\) .*/\1/p' "$work/path")
functions=$(grep -c '>:$' "$work/code")
[ "$functions" -gt 100 ] && [ "${bytes:-0}" -gt 1000 ] && grep -q 'deepest .* 0$' "$work/path"
check "calls and frames are found, without recursion ($functions functions)" "$work/path"
[ "${bytes:-$limit}" -le $limit ]
check "the deepest path takes $bytes bytes, at most $limit" "$work/path"
[ -z "${STACK_PATH-}" ] || cat "$work/path"

echo "1..$number"
[ $failed -eq 0 ]
