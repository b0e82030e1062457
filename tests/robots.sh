#!/bin/sh
# Motions of robots as their makers ship them, meshes, servos and all, from problem files without joint names, and writes
# results/robots.md: what the certificate says, iterations, seconds of one processor.
# Usage: sh tests/robots.sh [BUILD [MOTION...]]   (folder of a release build, by default build; with motions only their rows are
# solved anew, and the others stay, each with the commit it was measured at)
# The robots are in $CAVORT_SHARED_MODELS or ../shared/models; where they are absent nothing is written.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
chosen=" $* "
shared=${CAVORT_SHARED_MODELS:-../shared/models}
[ -d "$shared" ] || { echo "SKIPPED: no robots in $shared" && exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# number NAME SCALE FORMAT: a field of the last verdict
number() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$work/out/verdict.json" | awk -v s="$2" -v f="$3" '{ printf f, $1 * s }'; }

# word NAME: a field that is true or false, as yes or no
word() { sed -n "s/^ *\"$1\": \(true\|false\),*$/\1/p" "$work/out/verdict.json" | sed 's/true/yes/; s/false/no/'; }

# seconds of processor that children of this shell have taken, from what times has written
taken() { sed -n 2p "$1" | tr 'ms' '  ' | awk '{ print 60 * $1 + $2 + 60 * $3 + $4 }'; }

# row ROBOT MODEL MOTION [FILE]
row() {
  case "$chosen" in
    "  " | *" $3 "*) ;;
    *) grep -F "| $1 | $3 |" tests/results/robots.md && return 0 ;;
  esac
  rm -rf "$work/out"
  times >"$work/before"
  "$build/problems/cavort" solve "problems/motions/$3/${4:-problem}.xml" --model "$shared/$2" -o "$work/out" --threads 1 --quiet || true
  times >"$work/after"
  printf '| %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s |\n' "$1" "$3" "$(word certified)" "$(word achieved)" \
    "$(number cost 1 %.4g)" "$(number optimality 1 %.0e)" "$(number hover_fraction 100 %.2f)" "$(number slip_mean_m_s 1000 %.0f)" \
    "$(number momentum_defect_rms 100 %.2f)" "$(number closed_loop_end_error_m 1000 %.0f)" "$(number iterations 1 %d)" \
    "$(echo "$(taken "$work/before") $(taken "$work/after")" | awk '{ printf "%.1f", $2 - $1 }')" "$(git rev-parse --short HEAD)"
}

{
  echo "# Robots as shipped"
  echo
  echo "\`sh tests/robots.sh\`: one solve each by the own solver, one thread, the default schedule, the verification counted in. No problem file names a joint, a body or a geom."
  echo
  echo "- machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) processors, load $(cut -d ' ' -f 1 /proc/loadavg)"
  echo "- compiler: $(cc --version | head -n 1)"
  echo
  echo "| robot | motion | certified | achieved | cost | optimal to | hover, % | slip, mm/s | momentum defect, % | closed loop, end, mm | iterations | s of one processor | commit |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|"
  g1=unitree/g1/scene_29dof.xml go1=menagerie/unitree_go1/scene.xml arm=menagerie/ufactory_xarm7/xarm7.xml
  row xArm7 $arm arm-reach
  row xArm7 $arm arm-gate
  row "Unitree Go1" $go1 quadruped-jump
  row "Unitree Go1" $go1 quadruped-trot stride
  row "Unitree G1" $g1 robot-step
  row "Unitree G1" $g1 robot-jump
  row "Unitree G1" $g1 robot-reach
  row "Unitree G1" $g1 robot-squat
} >"$work/robots.md"
mv "$work/robots.md" tests/results/robots.md
cat tests/results/robots.md
