#!/bin/sh
# Kinematic fits of recorded clips that stand beside the repository. Usage: sh tests/mocap.sh BUILD [DATA]
# DATA (default ../shared/data): walk/ and cmu/. Prints two lines of each clip and model: frames, markers, rms, time; how good
# the motion is.
set -eu
build=${1:?usage: sh tests/mocap.sh BUILD [DATA]}
data=${2:-../shared/data}
[ -d "$data" ] || { echo "mocap: $data is not here"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# clip, marker set, model, and how
fit() {
  "$build/problems/cavort" ik "$1" --model "$3" --markers "problems/markers/$2.xml" ${4-} -o "$folder/fit" >"$folder/out"
  sed -n "s|^\([0-9]* frames.*\)|$(basename "$1") on $(basename "$3"), $2${4:+ $4}: \1|p" "$folder/out"
  awk -F, 'NR > 1 && $1 ~ /^(penetration|skating_fraction|floating_fraction|residual)$/ { printf "  %s %.3g %s", $1, $4, $2 }
           END { print "" }' "$folder/fit/quality.csv"
}
for how in "" --scale; do
  fit "$data/walk/markers_walk.trc" walk problems/models/humanoid.xml $how
done
for clip in "$data"/cmu/CMU*.xml; do
  for how in "" --scale; do
    fit "$clip" joints problems/models/humanoid.xml $how
  done
  for model in problems/models/humanoid.xml problems/models/robot.xml "$data/../models/unitree/g1/scene_29dof.xml"; do
    [ ! -f "$model" ] || fit "$clip" robot "$model"
  done
done
