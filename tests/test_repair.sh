#!/bin/sh
# From a clip to a motion that obeys physics, by the files that each command leaves to the next: a person of other size who glides over
# the floor, onto the robot, repaired, measured, beside the fit on one page. Usage: test_repair.sh CAVORT SOURCE_ROOT.
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failed=0
fail() {
  echo "failed: $*"
  sed 's/^/    /' out err 2>/dev/null | head -n 30
  failed=1
}
# value of a measure in a table: measure FILE COLUMN
measure() { awk -F, -v name="$1" -v column="$3" '$1 == name { print $column }' "$2"; }
under() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "" && a + 0 <= b + 0) }'; }

# 16 joints of a person of 1.5 m, standing, gliding forward at 20 cm/s, in 13 frames at 30 Hz
awk 'BEGIN {
  n = split("pelvis 0 0 0.84 head 0 0 1.38 ltoe 0.14 0.1 0.02 rtoe 0.14 -0.1 0.02 lheel -0.05 0.1 0.04 rheel -0.05 -0.1 0.04 " \
            "lknee 0.02 0.1 0.42 rknee 0.02 -0.1 0.42 lhand 0.05 0.22 0.78 rhand 0.05 -0.22 0.78 lelbow 0 0.22 1 relbow 0 -0.22 1 " \
            "lshoulder 0 0.16 1.24 rshoulder 0 -0.16 1.24 lhip 0 0.08 0.78 rhip 0 -0.08 0.78", word, " ")
  printf "time"
  for (i = 1; i <= n; i += 4) printf ",mocap[%s]_x,mocap[%s]_y,mocap[%s]_z", word[i], word[i], word[i]
  for (t = 0; t <= 12; t++) {
    printf "\n%.6f", t / 30
    for (i = 1; i <= n; i += 4) printf ",%.6f,%.6f,%.6f", word[i + 1] + 0.2 * t / 30, word[i + 2], word[i + 3]
  }
  print ""
}' >clip.csv

"$cavort" ik clip.csv --model "$root/problems/models/robot.xml" --markers "$root/problems/markers/robot.xml" -o fit >out 2>err || fail "ik"
grep -q '^next: cavort view fit.*cavort solve fit/repair.xml' out || fail "ik says what is next"
grep -q "clip scaled to the model: ways in the world by 0\.[0-9]" out || fail "no word of the scale"
sed 's/floor="true"/floor="true" pace="similar"/' "$root/problems/markers/robot.xml" >similar.xml
"$cavort" ik clip.csv --model "$root/problems/models/robot.xml" --markers similar.xml -o similar >out 2>err || fail "ik, similar"
grep -q ", times by 0\.[0-9]" out || fail "no word of the pace"
grep -q 'timestep="0.0166' similar/repair.xml || fail "steps of parts: $(grep timestep similar/repair.xml)"
under "$(measure skating fit/quality.csv 4)" 1 || fail "the fit slides"
under "$(measure penetration fit/quality.csv 4)" 1 || fail "the fit sinks"
"$cavort" quality --csv fit >own.csv 2>err || fail "a fit does not know its model"
cp fit/trajectory.csv alone.csv
"$cavort" quality alone.csv >out 2>err && fail "a table knows a model"
grep -q "give --model FILE" err || fail "no word of --model"
sed '1d' own.csv | cut -d, -f4 >own && sed '1d' fit/quality.csv | cut -d, -f4 | cmp -s - own || fail "quality of a fit by its own model differs"
"$cavort" solve -q --threads 1 fit/repair.xml -o repaired >out 2>err || fail "repair.xml is not solved"
"$cavort" quality --csv --model "$root/problems/models/robot.xml" fit repaired >table.csv 2>err || fail "no quality"
cut -d, -f1-4 table.csv | sed '1d' >before.csv
sed '1d' fit/quality.csv | cut -d, -f1-4 | cmp -s - before.csv || fail "ik and quality differ"
for bar in "penetration 5" "skating 1" "floating 20" "torque_excess 0" "residual_worst 0.1"; do
  # shellcheck disable=SC2086
  set -- $bar
  under "$(measure "$1" table.csv 5)" "$2" || fail "repaired, and $1 is $(measure "$1" table.csv 5)"
done
"$cavort" view fit repaired >out 2>err || grep -q "cannot read three.js" err || fail "no page of both"
[ ! -e fit-beside-repaired.view.html ] || grep -q '"label":"skating, quality"' fit-beside-repaired.view.html || fail "no table on the page"
exit $failed
