#!/bin/sh
# The tables of options: what is promised is taken and in --help, nothing half is taken, and completion and the manual page say
# the same. Usage: sh tests/e2e/options.sh BUILD_DIR. Prints TAP; exits 1 when a case failed.
set -u
. "$(dirname "$0")/../support/command.sh"

# What scripts rely on: command, words, options, each with a value. Nothing runs: the last option is unknown, so that reading
# ends there, and an option that is refused would end it before.
settings="--depth-scale=1000 --intrinsics=500,500,300,200 --translation=off --refine-rig=on --against=previous --prior=seed
    --start=previous --iterations=1,2,3 --size=320x240 --preset=tiny --voxel=0.02 --memory=64 --when-full=drop
    --fuse-behind=on --threads=1 --device=cpu --kernels=k.bin --set=huber_m=0.01"
live="--depth=openni2: --imu=none --rig=r --depth-size=320x240 --rate=30 --speed=0 --duration=1 --frames=2 --reconnect=off
    --json --progress --verbose"
cat >promised <<END
replay FOLDER --trajectory=t --mesh=m.ply --stats=s.csv --odometry=o --picture=p.png --imu=none --stride=2 --first=1 --outage=1:2
    --wall=1:2,3:4 --card=1:2 --progress --verbose $settings
scan - --trajectory=t --mesh=m.ply --stats=s.csv --odometry=o $live $settings
log FOLDER --force $live
devices - --json --verbose
simulate room_FOLDER --seed=2 --clean --motion=m --frames=3 --size=320x240 --length=20 --speed=2 --turn=1 --still=0 --blur --sensor=lidar --rate=20
    --exposure=0.01 --rolling=0.01 --imu-grade=phone --imu-rate=100 --imu-rotation=1,2,3 --imu-translation=0,0,0
    --imu-clock-offset=-0.1 --threads=1 --force --progress
calibrate FOLDER --output=- --offset-start=0 --offset-range=1 --imu=i.txt --progress --verbose $settings
info - --plan --settings --markdown --verbose $settings
kernels FILE --depth=640x480 --verbose $settings
selftest - --device=cpu --verbose
END
# One line a command.
awk '/^[a-z]/ && NR > 1 { printf "\n" } { sub(/^ +/, ""); printf "%s ", $0 } END { printf "\n" }' promised >lines
for name in $(cut -d' ' -f1 lines); do "$fathom" "$name" --help >"help.$name" 2>err || break; done
check "every command has --help, exit 0" err

while read -r name words options; do
    words=$(echo "$words" | tr _ ' ')
    # shellcheck disable=SC2086
    "$fathom" "$name" ${words#-} $options --no-such-option >out 2>err
    [ $? -eq 2 ] && [ "$(wc -l <err)" -eq 1 ] && grep -q 'unknown option --no-such-option' err && [ ! -s out ]
    check "$name takes each option that is promised" err
    for option in $options; do grep -q -e "^    ${option%%=*}\( \|$\)" "help.$name" || echo "${option%%=*}" ; done >missing
    grep -o '^    --[a-z-]*' "help.$name" | while read -r option; do
        case " $options " in *" $option "* | *" $option="*) ;; *) echo "$option isn't in the list here" ;; esac
    done >>missing
    [ ! -s missing ]
    check "$name --help lists these and no others" missing
    [ "$(awk 'length > 100' "help.$name" | wc -l)" -eq 0 ]
    check "$name --help fits into 100 columns" "help.$name"
done <lines

# ---- words and values

# wrong TEXT ARGUMENTS...: exit 2 with one line that holds the text.
wrong() {
    text=$1
    shift
    "$fathom" "$@" >out 2>err
    [ $? -eq 2 ] && [ "$(wc -l <err)" -eq 1 ] && grep -q -e "$text" err && [ ! -s out ]
    check "wrong: fathom $*: $text"
}
wrong 'unknown option --strid; did you mean --stride?' replay r --strid 2
wrong 'did you mean --picture?' replay r --pitcure p.png
wrong 'did you mean --offset-range?' calibrate r --offsetrange=1
wrong 'unknown option --colour; fathom' replay r --colour
wrong 'unknown option -x' replay r -x
wrong 'unknown option --see' simulate room r --see 3
wrong '\--mesh needs a value' replay r --mesh
wrong '\--mesh needs a value' replay r --mesh=
wrong '\--clean takes no value' simulate room r --clean=yes
wrong "'4' is none of on|off" replay r --refine-rig 4
wrong 'one word too many' simulate room r s
wrong 'no scene given' simulate
wrong "unknown command 'play'; fathom" play r
wrong "did you mean replay?" repaly r
wrong 'no command given'
wrong 'give the shell' --completion fish
# Each of these is a later version's, and says so.
for option in --trajectory-final=f --trajectory-format=kitti --report=r.html --json --save-map=m --save-every=3 --resume=m --salvage \
    --strict --flow=on --color=on --depth-topic=t --follow --cache=c; do
    wrong "${option%%=*}: not yet available" replay r $option
done
wrong 'not yet available' scan --serve
wrong 'not yet available' simulate room r --texture=low
wrong 'not yet available' calibrate r --color

"$fathom" replay -- -folder >out 2>err
[ $? -eq 1 ] && grep -q 'folder/depth.txt' err
check "after -- a word may begin with a dash"
"$fathom" replay --stride 2 there --mesh none/m.ply here >out 2>err
[ $? -eq 2 ] && grep -q 'more than one folder: there and here' err
check "words and options in any order"
POSIXLY_CORRECT=1 "$fathom" replay there --colour >out 2>err
[ $? -eq 2 ] && grep -q 'unknown option --colour' err
check "the same with POSIXLY_CORRECT"

# ---- completion

"$fathom" --completion bash >fathom.bash 2>err
check "completion for bash is written"
if command -v bash >/dev/null; then
    # completes WORDS...: what is offered for the last of them.
    completes() {
        bash -c 'source ./fathom.bash; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _fathom; printf "%s\n" "${COMPREPLY[@]}"' \
            fathom fathom "$@" 2>err
    }
    bash -n fathom.bash 2>err && while read -r name words options; do
        completes "$name" -- >offered
        for option in $options; do grep -qx -e "${option%%=*}" offered || { echo "$name ${option%%=*}" && exit 1; }; done
    done <lines >missing
    check "it lists every command's options" missing err
    completes re | grep -qx replay && completes replay r --against m | grep -qx model &&
        completes replay r --against = p | grep -qx previous && [ -z "$(completes replay r --against x)" ]
    check "commands, and words that a value may be"
    mkdir -p folder && touch file.png && completes replay fo | grep -qx folder && completes replay r --picture fi | grep -qx file.png &&
        [ -z "$(completes replay r --stride fi)" ]
    check "folders and files where they are meant"
else
    skip "completion lists every command's options" "no bash"
fi

# ---- the manual page

"$fathom" --man >fathom.1 2>err && sed 's/\\-/-/g' fathom.1 >plain && while read -r name words options; do
    grep -q "^.SS \"fathom $name" plain || exit 1
    for option in $options; do grep -q -e "fB${option%%=*}.fR" plain || { echo "$name ${option%%=*}" && exit 1; }; done
done <lines >missing
check "the manual page has every command and option" missing err
if command -v groff >/dev/null && [ -n "$(echo .TH | groff -man -Tascii 2>/dev/null)" ]; then
    groff -man -Tascii -ww -b fathom.1 >out 2>err && [ ! -s err ] && [ "$(wc -l <out)" -gt 100 ]
    check "groff renders it without a warning" err
else
    skip "groff renders the manual page" "no groff"
fi

echo "1..$number"
[ "$failed" -eq 0 ]
