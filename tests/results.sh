#!/bin/sh
# Writes the tables of tests/results anew, each with machine, compiler and commit. Usage: sh tests/results.sh [NAME...], default
# all of: inverse (time against MuJoCo, needs it and the shared models), conservation (drift of energy and momentum), orders
# (error of the orders of the step against their time), absent (what features cost where a scene has none of them), sensors, tendons, actuation, fluid (readings, strings, drives and
# drag against MuJoCo's).
# CAVORT_BUILD names a build folder, by default build.
set -eu
cd "$(dirname "$0")/.."

build=${CAVORT_BUILD:-build}
out=tests/results
[ -d "$build" ] || meson setup "$build" .

# a build before spatial tendons, equality constraints, fluids and further sensors and actuators were there
before=a83d729

provenance() {
  echo "$1"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) cores"
  echo "compiler  $(${CC:-cc} --version | head -n 1), $(meson introspect "$build" --buildoptions |
    sed 's/}, *{/}\n{/g' | sed -n 's/.*"name": "buildtype", "value": "\([^"]*\)".*/\1/p')"
  echo "commit    $(git rev-parse --short HEAD)$(git diff --quiet HEAD -- dynamics include || echo ' and changes')"
  echo
}

# run NAME PROGRAM: what a program of the tests prints, with its provenance; only whole files are left
run() {
  ninja -C "$build" "tests/$2" >/dev/null
  { provenance "sh tests/results.sh $1" && "$build/tests/$2"; } >"$out/$1.tmp"
  sed "s|$PWD/||; s|${CAVORT_SHARED_MODELS:-$PWD/../shared/models}|../shared/models|" "$out/$1.tmp" >"$out/$1.txt"
  rm "$out/$1.tmp"
}

# times of the humanoid's inverse by this build and by the one before, by turns
absent() {
  old=$(mktemp -d)
  trap 'git worktree remove --force "$old/tree"; rm -rf "$old"' EXIT
  git worktree add --quiet --detach "$old/tree" "$before"
  meson setup "$old/build" "$old/tree" >/dev/null
  ninja -C "$old/build" tests/bench_inverse >/dev/null
  ninja -C "$build" tests/bench_inverse >/dev/null
  for turn in 1 2 3 4 5 6 7 8 9; do
    "$old/build/tests/bench_inverse" problems/humanoid.xml | sed -n 's/^ *\([0-9]*\) - .* us *\([0-9.]*\) us .*us .*/\1 before \2/p'
    "$build/tests/bench_inverse" problems/humanoid.xml | sed -n 's/^ *\([0-9]*\) - .* us *\([0-9.]*\) us .*us .*/\1 now \2/p'
  done >"$old/times"
  {
    provenance "sh tests/results.sh absent"
    echo "Inverse of problems/humanoid.xml, which has no tendon, equality constraint, fluid or sensor: us,"
    echo "least and median of nine runs by turns, of this build and of one before all of those were there ($before)."
    echo
    echo "rows from   before: least, median   now: least, median   ratio of the least"
    for rows in 0 1 11 21 31 41 51 61; do
      for when in before now; do
        sed -n "s/^$rows $when //p" "$old/times" | sort -n | sed -n '1p;5p' | tr '\n' ' '
      done | awk -v rows="$rows" '{ printf "%9d   %13.2f %8.2f   %10.2f %8.2f   %18.3f\n", rows, $1, $2, $3, $4, $3 / $1 }'
    done
    echo
    echo "Memory of a state of it, cavort inspect:"
    ninja -C "$build" problems/cavort >/dev/null
    "$build/problems/cavort" inspect problems/humanoid.xml | sed -n '/memory of a state/,/the whole/p'
  } >"$out/absent.txt"
}

for name in ${*:-inverse conservation orders sensors tendons actuation fluid absent}; do
  case $name in
    inverse) run inverse bench_inverse ;;
    conservation) run conservation test_conservation ;;
    orders) run orders bench_orders ;;
    sensors) run sensors test_sensor ;;
    tendons) run tendons test_tendon ;;
    actuation) run actuation test_actuation ;;
    fluid) run fluid test_fluid ;;
    absent) absent ;;
    *) echo "usage: sh tests/results.sh [inverse|conservation|orders|sensors|tendons|actuation|fluid|absent]..." >&2 && exit 2 ;;
  esac
done
