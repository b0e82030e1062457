#!/bin/sh
# Recorded clips of people onto robots, and made to obey physics, two seconds at a time. Usage: sh tests/repair.sh BUILD [DATA] [MODEL...]
# DATA (default ../shared/data) holds cmu/; MODEL: humanoid, robot, g1 (default: all). Prints a table: of each part whether it is
# certified, seconds of processor for a second of it, and the qualities of the fit and of the result.
set -eu
build=${1:?usage: sh tests/repair.sh BUILD [DATA] [MODEL...]}
data=${2:-../shared/data}
[ $# -lt 2 ] || shift
shift
[ -d "$data/cmu" ] || { echo "repair: $data/cmu is not here"; exit 77; }
[ $# -gt 0 ] || set -- humanoid robot g1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
measure() { awk -F, -v name="$1" -v column="$2" '$1 == name { printf "%.3g", $column }' "$folder/table.csv"; }
echo "| model, clip | from, s | certified | processor, s/s | iterations | skating, % of frames, worst cm/s | floating, % | penetration, mm | residual, % | torque excess, % |"
echo "|---|---|---|---|---|---|---|---|---|---|"
for name in "$@"; do
  model=problems/models/$name.xml
  [ "$name" != g1 ] || model=$data/../models/unitree/g1/scene_29dof.xml
  [ -f "$model" ] || continue
  for clip in "$data"/cmu/CMU*.xml; do
    "$build/problems/cavort" ik "$clip" -q --model "$model" --markers problems/markers/robot.xml -o "$folder/fit"
    for from in 0 1.8; do
      status=0
      sh -c '"$@"; s=$?; times >"$0"; exit $s' "$folder/times" timeout 900 "$build/problems/cavort" solve "$folder/fit/repair.xml" -q \
        --threads 1 --strategies 3 --set horizon/@duration=2 --set "guess/@offset=$from" \
        --set "cost/track/@offset=$from" -o "$folder/part" 2>/dev/null || status=$?
      # the part of the fit
      awk -F, -v from="$from" 'NR == 1 || ($1 > from - 1e-6 && $1 < from + 2 + 1e-6)' "$folder/fit/trajectory.csv" |
        awk -F, -v OFS=, 'NR == 2 { first = $1 } NR > 1 { $1 = sprintf("%.12f", $1 - first) } 1' >"$folder/before.csv"
      "$build/problems/cavort" quality --csv --model "$model" "$folder/before.csv" "$folder/part" >"$folder/table.csv"
      seconds=$(tail -n 1 "$folder/times" | sed 's/[ms]/ /g' | awk '{ printf "%.1f", (60 * $1 + $2) / 2 }')
      iterations=$(sed -n 's/.*"iterations": \([0-9]*\).*/\1/p' "$folder/part/verdict.json")
      answer=yes
      [ "$status" = 0 ] || answer="no: $(sed -n 's/.*"reason": "\(.\{0,60\}\).*/\1/p' "$folder/part/verdict.json")"
      row="$name, $(basename "$clip" _poses.xml | sed 's/CMU-CMU-[0-9]*-//') | $from | $answer | $seconds | $iterations"
      row="$row | $(measure skating_fraction 4), $(measure skating 4) to $(measure skating_fraction 5), $(measure skating 5)"
      for one in floating_fraction penetration residual torque_excess; do row="$row | $(measure $one 4) to $(measure $one 5)"; done
      echo "| $row |"
      rm -rf "$folder/part"
    done
  done
done
