#!/bin/sh
# Plays solved motions in MuJoCo, under the contacts of the models' own files, and writes results/replay.md: how long each follows and
# how near it ends, beside what the certificate says; at other steps and from other starts than gains are chosen by; then with gains of
# half and of none, which have to be told apart.
# Usage: sh tests/replay.sh [FOLDER...]   (result folders; without any, all motions are solved first: an hour)
# CAVORT_MUJOCO_JS names npm's @mujoco/mujoco/mujoco.js, for models with servos, which Debian's MuJoCo does not read.
# CAVORT_BUILD names a release build with MuJoCo, by default build. FOLDERs are named after their motions, or r-MOTION.
set -eu
cd "$(dirname "$0")/.."
build=${CAVORT_BUILD:-build}
ninja -C "$build" tests/bench_replay problems/cavort >/dev/null
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ $# -eq 0 ]; then
  for motion in problems/motions/*/; do
    motion=$(basename "$motion")
    "$build/problems/cavort" solve "problems/motions/$motion/problem.xml" -o "$work/$motion" --threads 1 --quiet || true
    set -- "$@" "$work/$motion"
  done
fi

# servos with kv are for MuJoCo 3 alone: their controls are played there, open loop
servos=""
for folder in "$@"; do
  shift
  case "$(basename "$folder")" in
    arm-* | r-arm-*) servos="$servos $folder" ;;
    *) set -- "$@" "$folder" ;;
  esac
done

# table FACTOR FOLDER...
table() {
  echo
  echo "| motion | certified | achieved | lasts, s | closed loop until, s | ends, mm | model's contacts until, s | end, mm | MuJoCo 1 ms until, s | end, mm | root, mm | MuJoCo 2 ms until, s | end, mm | root, mm | push survived, N s |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
  "$build/tests/bench_replay" "$@"
}

{
  echo "# Motions replayed in MuJoCo"
  echo
  echo "\`sh tests/replay.sh\`: solved motions in MuJoCo with the contacts of the model's file, feedforward and gains through MuJoCo's actuators. Until: all bodies within 0.5 m and roots within 1 rad; end: the farthest centre of mass then. The closed loop under the claimed law and under the model's contacts, the worst of steps of 1 and 2 ms and of four starts a little off, are the certificate's. Cycles run for their \`periods\`."
  echo
  echo "- machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)"
  echo "- compiler: $(cc --version | head -n 1)"
  echo "- commit: $(git rev-parse --short HEAD)"
  table 1 "$@"
  echo
  echo "At steps that neither the certificate nor the choice of gains sees, and at 1 ms from eight starts that are off the plan by up to 0.03 m/s or rad/s and 0.003 m or rad of each joint:"
  echo
  echo "| motion | lasts, s | 0.5 ms until, s | end, mm | 4 ms until, s | end, mm | starts followed to the end | the worst of these, mm |"
  echo "|---|---|---|---|---|---|---|---|"
  "$build/tests/bench_replay" apart "$@"
  if [ -n "$servos" ] && [ -n "${CAVORT_MUJOCO_JS:-}" ]; then
    echo
    echo "Servos of the arm in MuJoCo 3.14: their controls alone, open loop (\`node tests/replay_servo.mjs\`), the farthest centre of mass:"
    echo
    node tests/replay_servo.mjs problems/models/arm.xml $servos | sed 's/^/- /'
  fi
  for factor in 0.5 0.2 0; do
    echo
    echo "Gains times $factor:"
    table "$factor" "$@"
  done
} >"$work/replay.md"
mv "$work/replay.md" tests/results/replay.md
