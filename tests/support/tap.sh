# For the e2e_*.sh scripts, to be sourced: TAP lines (testanything.org), counted in $number and $failed.
number=0
failed=0

# check TEXT [FILE...]: reports on the status of the command before it; the files (else ./err and ./out) say what went wrong.
check() {
    result=$?
    number=$((number + 1))
    text=$1
    shift
    [ $# -gt 0 ] || set -- err out
    if [ $result -eq 0 ]; then
        echo "ok $number - $text"
    else
        echo "not ok $number - $text"
        for file in "$@"; do head -n 40 "$file" 2>/dev/null | sed 's/^/#   /'; done
        failed=$((failed + 1))
    fi
}

# skip TEXT WHY: a case that can't run here.
skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}
