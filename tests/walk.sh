#!/bin/sh
# A recorded walk (OpenSim's example, markers at 100 Hz) to forces by cavort track, beside what force plates measured of it, and
# beside what kinematics alone give with the plates' event times. Usage: sh tests/walk.sh BUILD [DATA]
# DATA (default ../shared/data) has walk/: markers_walk.trc, grf_walk.mot. What cavort track asks for was tuned on the first
# window of time; the second checks it, the third is all that plates saw. Curves for gnuplot are left in BUILD/walk. Plates are
# read by the comparison alone: the solves see markers and the subject's mass.
set -eu
build=${1:?usage: sh tests/walk.sh BUILD [DATA]}
data=${2:-../shared/data}/walk
mass=85.3 # kg, of the subject
[ -d "$data" ] || { echo "walk: $data is not here"; exit 77; }
mkdir -p "$build/walk"
work=$build/walk

# NAME FROM UNTIL
stride() {
  "$build/problems/cavort" track "$data/markers_walk.trc" --model problems/models/gait.xml --markers problems/markers/gait.xml --scale \
    --mass $mass --from "$2" --until "$3" --threads 1 -q -o "$work/$1" || true
  printf '\n%s: %s to %s s\n' "$1" "$2" "$3"
  sed -n 's/^  "certified": \(.*\),$/certified: \1/p; s/^  "reason": "\(..*\)",$/  \1/p; s/^  "solve_seconds": \([0-9]*\.[0-9]\).*/solved in \1 s/p' \
    "$work/$1/result/verdict.json"
  "$build/tests/walk_compare" "$work/$1/ik/model.xml" "$work/$1/ik/markers.xml" "$data/markers_walk.trc" "$work/$1/ik/trajectory.csv" \
    "$work/$1/result" "$data/grf_walk.mot" "$2" "$work/$1.dat"
}

stride tuned 0.5 1.4
stride checked 1.05 2
stride whole 0.15 2.25
