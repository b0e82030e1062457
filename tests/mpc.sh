#!/bin/sh
# Balance under pushes, walking after a target and getting up under model-predictive control, into tests/results/mpc.md. All but the
# times is the same on every machine. Usage: sh tests/mpc.sh [BUILD]   (folder of a release build, by default build)
set -eu
build=${1:-build}
case $build in
  /*) ;;
  *) build=$(pwd)/$build ;;
esac
cd "$(dirname "$0")/.."
cavort=$build/problems/cavort
work=$(mktemp -d)
out=tests/results/mpc.md
trap 'rm -rf "$work"' EXIT

# what a run of cavort mpc says, as a row: runs that stand, mean and largest straying, processor times
row() {
  name=$1
  problem=$2
  shift 2
  "$cavort" mpc "$problem" -o "$work/run" "$@" >"$work/out" || true
  awk -v name="$name" '
    / stands, | does not stand, / { runs++; stand += / stands, /
      for (i = 1; i <= NF; i++) if ($i == "strayed") { sum += $(i + 1); if ($(i + 1) > most) most = $(i + 1) } }
    /^[0-9]+ plans: / { sub(/.*processor /, ""); gsub(/ms|and/, ""); median = $1; late = $2 }
    END { printf "| %s | %d of %d | %.2f | %.2f | %.2f | %.2f |\n", name, stand, runs, sum / runs, most, median, late }' "$work/out"
}

stand() {
  name=$1
  push=$2
  shift 2
  row "$name" problems/mpc/stand.xml --push "$push" "$@"
}

# the same push from three more instants each: thirty runs
thirty() {
  name=$1
  impulse=$2
  shift 2
  row "$name" problems/mpc/stand.xml --push "$impulse torso around 0.5" --push "$impulse torso around 0.507" \
    --push "$impulse torso around 0.513" "$@"
}

{
  echo "sh tests/mpc.sh"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), $(nproc) cores"
  echo "commit    $(git describe --always --dirty)"
  echo
  echo "Our humanoid, 27 dofs, the body simulated at 1 ms in the contacts of its model's file. Where nothing else is said: 40 knots of 25 ms, a"
  echo "hundred plans a second, two iterations each, in force 10 ms after their state, springs of 40 rad/s; pushes of 0.1 s on the torso in ten"
  echo "directions around and ten instants. Strayed: the centre of mass, level, from its start (m), mean and largest. Plan: processor time"
  echo "of one thread for a plan (ms), looking ahead included."
  echo
  echo "| push and change | stands | strayed, mean | largest | plan, median | 99 % |"
  echo "|---|---|---|---|---|---|"
  thirty "20 N s, thirty instants" 20
  thirty "40 N s, thirty instants" 40
  stand "60 N s" "60 torso around 0.5"
  thirty "20 N s, 20 knots, thirty instants" 20 --knots 20
  thirty "40 N s, 20 knots, thirty instants" 40 --knots 20
  stand "40 N s, 30 knots" "40 torso around 0.5" --knots 30
  stand "20 N s, one iteration" "20 torso around 0.5" --iterations 1
  stand "40 N s, one iteration" "40 torso around 0.5" --iterations 1
  stand "40 N s, three iterations" "40 torso around 0.5" --iterations 3
  stand "20 N s, 50 plans a second" "20 torso around 0.5" --rate 50
  stand "40 N s, 50 plans a second" "40 torso around 0.5" --rate 50
  stand "20 N s, 25 plans a second" "20 torso around 0.5" --rate 25
  for rate in 0 10 20 60; do
    stand "40 N s, springs of $rate rad/s" "40 torso around 0.5" --stiffness $rate
  done
  stand "20 N s within 1 ms" "20 torso around 0.5 0.001"
  stand "40 N s within 1 ms" "40 torso around 0.5 0.001"
  row "walking after a target that moves 1.5 m ahead and 0.5 m aside" problems/mpc/walk.xml --knots 40 --duration 11
  "$cavort" solve problems/motions/get-up-front/problem.xml --threads 1 --strategies 1 -q -o "$work/get-up" >/dev/null || true
  sed "s|../../get-up-front.result|$work/get-up|; s|../models|$PWD/problems/models|" problems/mpc/get-up.xml >"$work/get-up.xml"
  row "getting up, along the certified motion" "$work/get-up.xml" --knots 40 --duration 5
  row "the same, pushed by 10 N s" "$work/get-up.xml" --knots 40 --push "10 torso around 1" --duration 5
} >"$work/table"
if "$build/tests/test_mpc_peer" 20 10 >"$work/peer" 2>&1 && "$build/tests/test_mpc_peer" 40 10 >>"$work/peer" 2>&1; then
  {
    echo
    echo "The same controller with MuJoCo as the body ($build/tests/test_mpc_peer N_S 10):" | sed "s|$build|build|"
    echo
    grep 'N s, 0 degrees\|stands after' "$work/peer" | sed 's/, 0 degrees.*/:/' | paste - - | sed 's/\t/ /; s/^/- /'
  } >>"$work/table"
fi
mv "$work/table" $out
cat $out
