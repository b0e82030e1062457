#!/bin/sh
# Estimation on line of our humanoid under pushes, error against run time, into tests/results/mhe.md. All but the times is the same on
# every machine. Usage: sh tests/mhe.sh [BUILD]   (folder of a release build, by default build)
set -eu
build=${1:-build}
case $build in
  /*) ;;
  *) build=$(pwd)/$build ;;
esac
cd "$(dirname "$0")/.."
work=$(mktemp -d)
out=tests/results/mhe.md
trap 'rm -rf "$work"' EXIT
"$build/tests/bench_mhe" >"$work/rows"
{
  echo "sh tests/mhe.sh"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), $(nproc) cores"
  echo "commit    $(git describe --always --dirty)"
  echo
  echo "Our humanoid, 27 dofs, simulated at 1 ms in the contacts of its model's file, controlled by problems/mpc/stand.xml from the true state, pushed on"
  echo "the torso for 0.1 s; estimated by problems/mhe/stand.xml at 100 Hz from joint encoders (1 mrad), an accelerometer (0.1 m/s2) and a gyro (0.01 rad/s)"
  echo "in the torso and the motors' torques (1 N m). No sensor of place. Errors against the simulation at the time of each sample, rms over 3 s, in"
  echo "brackets standard errors as told: of the torso's velocity, tilt and place. Feet: rms error of the normal force of each; wrong: samples in which a foot"
  echo "bears more than 20 N or does not, and is told otherwise; push: error of the force along y on the torso, which nothing measures. Chi-square of a"
  echo "window over its readings, mean and largest of the samples: 1 where model and noise are right. Update: processor"
  echo "time of one thread once the window is full; late: of these more than 10 ms."
  echo
  echo "| push, N s | knots | iterations | missing, % | velocity, cm/s | tilt, degrees | place, mm | feet, N | wrong, % | push, N | chi-square | update, ms | 99 % | a second | late |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
  grep '^|' "$work/rows"
} >"$work/table"
mv "$work/table" $out
cat $out
