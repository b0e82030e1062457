#!/bin/sh
# A recorded walk (OpenSim's example, markers at 100 Hz) to forces, beside what force plates measured of it, and beside what
# kinematics alone give with the plates' event times. Usage: sh tests/walk.sh BUILD [DATA]
# DATA (default ../shared/data) has walk/: markers_walk.trc, grf_walk.mot. Weights were tuned on the first window of time; the
# second checks them, the third is all that plates saw. Curves for gnuplot are left in BUILD/walk. Plates are read by
# this script alone: the solves see markers and the subject's mass.
set -eu
build=${1:?usage: sh tests/walk.sh BUILD [DATA]}
data=${2:-../shared/data}/walk
mass=85.3 # kg, of the subject
[ -d "$data" ] || { echo "walk: $data is not here"; exit 77; }
data=$(cd "$data" && pwd)
mkdir -p "$build/walk"
work=$(cd "$build/walk" && pwd)
tool=$build/problems/cavort

"$tool" ik "$data/markers_walk.trc" --model problems/models/gait.xml --markers problems/markers/gait.xml --scale --mass $mass \
  -o "$work/fit" | sed -n '/^segment/,/^model/p; /^[0-9]* frames/p'

stride() {
  offset=$2
  sed "s|FIT|$work/fit|; s|CLIP|$data/markers_walk.trc|; s|OFFSET|$offset|; s|DURATION|$3|" tests/walk/problem.in \
    >"$work/$1.xml"
  "$tool" solve "$work/$1.xml" -o "$work/$1" --threads 1 --strategies 1 -q || true
  printf '\n%s: %s s from %s s on\n' "$1" "$3" "$offset"
  sed -n 's/^  "certified": \(.*\),$/certified: \1/p; s/^  "reason": "\(..*\)",$/  \1/p; s/^  "solve_seconds": \([0-9]*\.[0-9]\).*/solved in \1 s/p' \
    "$work/$1/verdict.json"
  "$build/tests/walk_compare" "$work/fit/model.xml" "$work/fit/markers.xml" "$data/markers_walk.trc" "$work/fit/trajectory.csv" "$work/$1" \
    "$data/grf_walk.mot" "$offset" "$work/$1.dat"
}

stride tuned 0.5 0.9
stride checked 1.05 0.95
stride whole 0.15 2.1
