#!/bin/sh
# Swing-ups of dm_control's models, hung from below, the goal as a cost at the end, in so many seconds: what comes of each, and the
# first line that says why or what was changed. Writes results/swings.md. Usage: sh tests/swings.sh [BUILD]
# The models are those of $CAVORT_SHARED_MODELS or ../shared/models.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
shared=$(cd "${CAVORT_SHARED_MODELS:-../shared/models}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# row MODEL JOINT SECONDS
row() {
  cat >"$work/problem.xml" <<END
<problem name="up" model="$shared/dm_control/$1.xml"><horizon duration="$3" timestep="0.025"/><start><joint name="$2" degrees="180"/>
</start><goal/><cost><posture dofs="all" at="end" weight="900"/></cost></problem>
END
  status=0
  "$build/problems/cavort" solve "$work/problem.xml" -o "$work/out" --threads 1 >"$work/said" 2>&1 || status=$?
  line=$(sed -n 's/^cavort: \(impossible: .*\)/\1/p; s/^cavort: \(actuators are .*\)/\1/p; s/^strategy repaired: \(.*\) (the folder.*/\1/p' \
    "$work/said" | head -n 1)
  [ "$status" != 0 ] || [ -n "$line" ] || line="as stated$(sed -n 's/^kept: strategy \([^,]*\).*/, strategy \1/p' "$work/said")"
  printf '| %s | %s | %d | %s |\n' "$1" "$3" "$status" "$line"
}

{
  echo "# Swing-ups"
  echo
  echo "\`sh tests/swings.sh\`, commit $(git rev-parse --short HEAD): dm_control's models hung from below, the goal as a cost at the end."
  echo "Exit status 0 is certified and achieved."
  echo
  echo "| model | seconds | exit status | what is said |"
  echo "|---|---|---|---|"
  for seconds in 4 5 6 7 8 9 10; do row pendulum hinge $seconds; done
  for seconds in 2 3 4 6 8; do row cartpole hinge_1 $seconds; done
  for seconds in 5 6 7 8; do row acrobot shoulder $seconds; done
} >"$work/swings.md"
mv "$work/swings.md" tests/results/swings.md
cat tests/results/swings.md
