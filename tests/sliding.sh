#!/bin/sh
# Solves motions that slide, roll or swing fast under both laws of sliding contacts, one after the other, and writes
# results/sliding.md. Usage: sh tests/sliding.sh [BUILD [MOTION...]]   (folder of a release build, by default build; with motions
# only their rows are solved anew). Only the problem's own guess is tried; the coarser backflip is the same at a step of 20 ms.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
chosen=" $* "
table=tests/results/sliding.md
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# number NAME SCALE FORMAT: a field of the last verdict
number() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$work/out/verdict.json" | awk -v s="$2" -v f="$3" '{ printf f, $1 * s }'; }

# cost of the last stage that minimised it
cost() { grep -v "restoration\|diagnosis" "$work/out/stages.csv" | tail -n 1 | awk -F , '{ printf "%.4f", $5 }'; }

# what is missed, in a few words
missed() { sed -n 's/^ *"reason": "\([^(:]*\)[(:]*.*$/\1/p' "$work/out/verdict.json" | sed 's/",*$//; s/ *$//'; }

# row NAME LAW PROBLEM [EXPRESSION]: of sed, on the problem
row() {
  case "$chosen" in
    "  " | *" $1 "*) ;;
    *) grep -F "| $1 | $2 |" "$table" && return 0 ;;
  esac
  folder=$(cd "$(dirname "$3")" && pwd)
  if grep -q "<schedule" "$3"; then
    law="s|<schedule|<schedule sliding=\"$2\"|"
  else
    law="s|</problem>|<schedule sliding=\"$2\"/></problem>|"
  fi
  sed "s|model=\"|model=\"$folder/|; $law; ${4:-}" "$3" >"$work/problem.xml"
  rm -rf "$work/out"
  "$build/problems/cavort" solve "$work/problem.xml" -o "$work/out" --threads 1 --strategies 1 --quiet >/dev/null 2>&1 || true
  certified=$(sed -n 's/^ *"certified": \([a-z]*\),*$/\1/p' "$work/out/verdict.json")
  [ "$certified" = true ] && certified=yes || certified="no: $(missed)"
  printf '| %s | %s | %s | %s | %s | %s | %s | %s | %s | %s |\n' "$1" "$2" "$certified" "$(number iterations 1 %d)" "$(cost)" \
    "$(number hover_fraction 100 %.2f)" "$(number slip_mean_m_s 1000 %.1f)" "$(number optimality 1 %.0e)" \
    "$(number replay_same_step_seconds 1 %.2f)" "$(git rev-parse --short HEAD)"
}

# both NAME PROBLEM [EXPRESSION]
both() {
  for law in convex coulomb; do row "$1" $law "$2" "${3:-}"; done
}

{
  echo "# Laws of sliding contacts"
  echo
  echo "\`sh tests/sliding.sh\`: one solve each from the problem's own guess, one thread, the default schedule but for the law (coulomb from three quarters of the way on). Leaning on air: contact force, by impulse, across gaps over 3 mm that stay open at the next knot; at most 3 % in a certified motion. Push and bowl slide all the time or at first, which no certificate allows (slip); the known optima are 0.0638 and 0."
  echo
  echo "- machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) processors"
  echo "- compiler: $(cc --version | head -n 1)"
  echo
  echo "| motion | law | certified | iterations | cost | leaning on air, % | slip, mm/s | optimality | same-step replay within 1e-6, s | commit |"
  echo "|---|---|---|---|---|---|---|---|---|---|"
  both push tests/sliding/push.xml
  both bowl tests/sliding/bowl.xml
  for motion in walk run kick squat-jump jump step-up cartwheel handstand; do
    both $motion "problems/motions/$motion/problem.xml"
  done
  both backflip problems/motions/backflip/problem.xml
  both "backflip, 20 ms" problems/motions/backflip/problem.xml 's/timestep="0.01"/timestep="0.02"/'
} >"$work/sliding.md"
mv "$work/sliding.md" "$table"
cat "$table"
