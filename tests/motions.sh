#!/bin/sh
# Solves the motions, one after the other, and writes results/solve.md: time, iterations, what the certificate says.
# Usage: sh tests/motions.sh [BUILD [MOTION...]]   (folder of a release build, by default build; with motions only their rows are
# solved anew, and the others stay, each with the commit it was measured at)
# CAVORT_OTHERS=all tries the motions on models that no one here wrote, too, those of MuJoCo and dm_control in $CAVORT_SHARED_MODELS or
# ../shared/models; rows of absent ones are left out.
# CAVORT_RESULTS=DIR keeps the result folders as DIR/MOTION, for tests/replay.sh.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
chosen=" $* "
shared=${CAVORT_SHARED_MODELS:-../shared/models}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# number NAME SCALE FORMAT: a field of the last verdict
number() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$out/verdict.json" | awk -v s="$2" -v f="$3" '{ printf f, $1 * s }'; }

# word NAME: a field that is true or false, as yes or no
word() { sed -n "s/^ *\"$1\": \(true\|false\),*$/\1/p" "$out/verdict.json" | sed 's/true/yes/; s/false/no/'; }

# tried EXPRESSION: of awk over the strategies that were tried: $1 name, $2 kept, $6 seconds
tried() { awk -F , "NR > 1 && \$6 != \"\" { $1 } END { $2 }" "$out/strategies.csv"; }

# row MOTION [MODEL]
row() {
  if [ $# -gt 1 ]; then
    [ -f "$shared/$2" ] || return 0
    set -- "$1" "$2" --model "$shared/$2"
  else
    set -- "$1" "problems/motions/$1/$(sed -n 's/^<problem .*model="\([^"]*\)".*/\1/p' "problems/motions/$1/problem.xml")"
    set -- "$1" "$(realpath --relative-to=. "$2")"
  fi
  motion=$1
  out=${CAVORT_RESULTS:-$work}/$motion
  name=$2
  shift 2
  case "$chosen" in
    "  " | *" $motion "*) ;;
    *) grep -F "| $motion | $name |" tests/results/solve.md && return 0 ;;
  esac
  "$build/problems/cavort" solve "problems/motions/$motion/problem.xml" -o "$out" --threads 1 --quiet "$@" || true
  printf '| %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %s |\n' "$motion" "$name" \
    "$(word certified)" "$(word achieved)" "$(number cost 1 %.4g)" "$(number optimality 1 %.0e)" "$(number hover_fraction 100 %.2f)" \
    "$(tried 'if ($2) print $1' '')" "$(tried 's += $6' 'printf "%.1f", s')" "$(number iterations 1 %d)" "$(number unactuated_force_max 1 %.0e)" \
    "$(number momentum_defect_rms 100 %.2f)" "$(number penetration_max_m 1000 %.1f)" "$(number slip_mean_m_s 1000 %.0f)" \
    "$(number replay_same_step_seconds 1 %.2f)" "$(number closed_loop_end_error_m 1000 %.0f)" \
    "$(git rev-parse --short HEAD)"
}

{
  echo "# Motions"
  echo
  echo "\`sh tests/motions.sh\`: one solve each by the own solver, one thread, the default schedule. Strategy: stated is the problem's own naive guess; others are tried where it does not lead to a certificate with all that was asked, and their seconds count."
  echo
  echo "- machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) processors, load $(cut -d ' ' -f 1 /proc/loadavg)"
  echo "- compiler: $(cc --version | head -n 1)"
  echo
  echo "| motion | model | certified | achieved | cost | optimal to | hover, % | strategy | s, all strategies | iterations | unactuated force, of weight | momentum defect, % | penetration, mm | slip, mm/s | same-step replay within 1e-6, s | closed loop, end, mm | commit |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
  row squat-jump
  [ "${CAVORT_OTHERS:-own}" != all ] || row squat-jump mujoco/humanoid.xml
  [ "${CAVORT_OTHERS:-own}" != all ] || row squat-jump dm_control/humanoid.xml
  row hopper-hop
  row walker-jump
  row cheetah-jump
  row hop
  row walker-walk
  row cheetah-gallop
  row quadruped-trot
  if [ "${CAVORT_OTHERS:-own}" = all ]; then
    for pair in hopper-hop:hopper walker-jump:walker cheetah-jump:cheetah hop:hopper walker-walk:walker cheetah-gallop:cheetah; do
      row "${pair%:*}" "dm_control/${pair#*:}.xml"
    done
  fi
  for motion in jump kick reach get-up-back get-up-front lie-down walk walk-cycle run step-up stairs roll handstand cartwheel backflip lift; do
    row $motion
    [ "${CAVORT_OTHERS:-own}" = all ] || continue
    row $motion mujoco/humanoid.xml
    row $motion dm_control/humanoid.xml
  done
  for motion in turn-round side-step walk-back push-up one-leg dance jump-half-turn sit-stand under-bar crawl touch-floor turn-over kick-ball throw push-box; do row $motion; done
  row quadruped-jump
  row robot-squat
  row robot-reach
  row robot-step
  row robot-jump
  row arm-reach
  row arm-gate
  echo
  echo "Those of test_solve are tests; the others stand as the table says. Joint, tendon and actuator limits hold to 1e-6 in every certified row."
} >"$work/solve.md"
mv "$work/solve.md" tests/results/solve.md
cat tests/results/solve.md
