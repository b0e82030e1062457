#!/bin/sh
# Obstacles stated in minutes: a standing start, a standing goal, boxes between, and nothing else; solved with the boxes as they are
# and with solids that grow (optim/METHOD.md, 5). Prints a table; 5 to 15 minutes. Or, of edges, lower ones without and with the
# default cost of forces at edges and with <force weight="1"/> (optim/METHOD.md, 4), and the motion stairs in other times and with
# more effort.
# Usage: sh tests/obstacles.sh [BUILD [NAME...]]   (folder of a release build, by default build; climb, stairs, wall)
#        sh tests/obstacles.sh BUILD edges
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- climb stairs wall
what=solids
[ "$1" != edges ] || what=edges
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# box X HALF_LENGTH HEIGHT
box() { echo "<geom name='box$1' type='box' pos='$1 0 $(awk "BEGIN { print $3 / 2 }")' size='$2 .6 $(awk "BEGIN { print $3 / 2 }")' friction='.8'/>"; }

# state NAME GOAL RISE DURATION BOXES [RISE_OF_START]
state() {
  joints=$(for joint in hip_y:-5 knee:-10 ankle_y:-5; do
    for side in right left; do echo "<joint name='${joint%:*}_$side' degrees='${joint#*:}'/>"; done
  done)
  cat >"$work/$1.xml" <<END
<problem name="$1" model="$PWD/problems/models/humanoid.xml">
  <scene>$5</scene>
  <horizon duration="$4" timestep="0.03"/>
  <pose name="stand"><root pos="0 0 1" euler="0 0 0"/>$joints</pose>
  <start key="stand" height="floor" rise="${6:-0}"/>
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

edges() {
  state up-0.15 0.75 0.15 3 "$(box 0.8 0.35 0.15)"
  state up-0.3 0.75 0.3 3 "$(box 0.8 0.35 0.3)"
  state down-0.15 0.75 0 2.4 "$(box 0 0.3 0.15)" 0.15
  state down-0.2 0.65 0 2.4 "$(box 0 0.3 0.2)" 0.2
  state over-0.15 1.2 0 3 "$(box 0.6 0.15 0.15)"
  state two-steps 1.1 0.3 3.6 "$(box 0.55 0.15 0.15)$(box 1.15 0.45 0.3)"
  sed -i 's#<cost>#<cost><force weight="0"/><edge_force weight="0"/>#' "$work"/*.xml
  for setting in 3:0.7 2.8:0.7 4:0.7 3:0.8; do
    sed "s#<force weight=\"1\"/>#<force weight=\"0\"/><edge_force weight=\"0\"/>#; s#\.\./\.\./models#$PWD/problems/models#" \
      problems/motions/stairs/problem.xml >"$work/stairs-$setting.xml"
  done
  echo "| problem | forces at edges, of contacts | cost | closed loop until, s | in the model's contacts | certified | seconds |"
  echo "|---|---|---|---|---|---|---|"
  for name in up-0.15 up-0.3 down-0.15 down-0.2 over-0.15 two-steps stairs-3:0.7 stairs-2.8:0.7 stairs-4:0.7 stairs-3:0.8; do
    for weights in 0:0 0:1 10:0 10:1; do
      setting=${name#stairs-}
      [ "$setting" = "$name" ] || set -- --set "horizon/@duration=${setting%:*}" --set "limits/@effort=${setting#*:}"
      [ "$setting" != "$name" ] || set --
      "$build/problems/cavort" solve "$work/$name.xml" -o "$work/result" --set "cost/edge_force/@weight=${weights%:*}" \
        --set "cost/force/@weight=${weights#*:}" "$@" --strategies 1 --threads 1 --quiet || true
      echo "| $name | ${weights%:*}, ${weights#*:} | $(number cost %.4g) | $(number closed_loop_seconds %.2f) |" \
        "$(number model_contacts_seconds %.2f) | $(sed -n 's/^ *"certified": \([a-z]*\),*$/\1/p' "$work/result/verdict.json") | $(number solve_seconds %.0f) |"
      rm -rf "$work/result"*
    done
  done
}

if [ "$what" = edges ]; then
  edges
  exit
fi
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
