#!/bin/sh
# Kinematic fits of recorded clips that stand beside the repository. Usage: sh tests/mocap.sh BUILD [DATA]
# DATA (default ../shared/data): walk/ and cmu/. Prints two lines each, of the model as it is and with its sizes fitted: clip,
# frames, markers, rms, time.
set -eu
build=${1:?usage: sh tests/mocap.sh BUILD [DATA]}
data=${2:-../shared/data}
[ -d "$data" ] || { echo "mocap: $data is not here"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fit() {
  for sizes in "" --scale; do
    # shellcheck disable=SC2086
    "$build/problems/cavort" ik "$1" --model problems/models/humanoid.xml --markers "problems/markers/$2.xml" $sizes -o "$folder/fit" |
      sed -n "s|^\([0-9]* frames.*\)|$(basename "$1") ${sizes:-as it is}: \1|p"
  done
}
fit "$data/walk/markers_walk.trc" walk
for clip in "$data"/cmu/CMU*.xml; do fit "$clip" joints; done
