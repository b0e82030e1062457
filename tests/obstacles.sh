#!/bin/sh
# Obstacles stated in minutes: a standing start, a standing goal, boxes between, and nothing else; solved with the boxes as they are
# and with solids that grow (optim/METHOD.md, 5). Prints a table; 5 to 15 minutes.
# Usage: sh tests/obstacles.sh [BUILD [NAME...]]   (folder of a release build, by default build; climb, stairs, wall)
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- climb stairs wall
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# box X HALF_LENGTH HEIGHT
box() { echo "<geom name='box$1' type='box' pos='$1 0 $(awk "BEGIN { print $3 / 2 }")' size='$2 .6 $(awk "BEGIN { print $3 / 2 }")' friction='.8'/>"; }

# state NAME GOAL RISE DURATION BOXES GUESS
state() {
  joints=$(for joint in hip_y:-5 knee:-10 ankle_y:-5; do
    for side in right left; do echo "<joint name='${joint%:*}_$side' degrees='${joint#*:}'/>"; done
  done)
  cat >"$work/$1.xml" <<END
<problem name="$1" model="$PWD/problems/models/humanoid.xml">
  <scene>$5</scene>
  <horizon duration="$4" timestep="0.03"/>
  <pose name="stand"><root pos="0 0 1" euler="0 0 0"/>$joints</pose>
  <start key="stand" height="floor"/>
  <goal key="stand" height="floor" rise="$3"><root pos="$2 0 1"/></goal>
  <cost>
    <posture name="final posture" dofs="all" at="end" weight="900"/>
    <velocity name="final rest" dofs="all" at="end" weight="100"/>
  </cost>
</problem>
END
}
state climb 0.9 0.6 3.6 "$(box 0.9 0.5 0.6)"
state stairs 1.3 0.45 3.6 "$(box 0.55 0.15 0.15)$(box 0.85 0.15 0.3)$(box 1.45 0.45 0.45)"
state wall 1.2 0 2.4 "$(box 0.6 0.05 0.3)"

number() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$work/result/verdict.json" | awk "{ printf \"$2\", \$1 }"; }

echo "| problem | solids | unactuated force, of weight | cost | momentum defect | closed loop until, s | iterations |"
echo "|---|---|---|---|---|---|---|"
for name; do
  for solids in hard grow; do
    "$build/problems/cavort" solve "$work/$name.xml" -o "$work/result" --set "schedule/@solids=$solids" --strategies 1 --threads 1 \
      --quiet || true
    echo "| $name | $solids | $(number unactuated_force_max %.1g) | $(number cost %.4g) | $(number momentum_defect_rms %.1g) |" \
      "$(number closed_loop_seconds %.2f) | $(number iterations %d) |"
    rm -rf "$work/result"*
  done
done
