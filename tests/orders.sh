#!/bin/sh
# Solves motions under the orders midpoint and momentum of the step, from the stated guess alone, and writes results/orders.md.
# Usage: sh tests/orders.sh [BUILD [theft]]   (folder of a release build, by default build). theft: a jump of 2 m instead, which no
# motion of a humanoid's strength makes, under each order; a table to standard output.
# The models that no one here wrote come from $CAVORT_SHARED_MODELS or ../shared/models; rows of absent ones are left out.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
shared=${CAVORT_SHARED_MODELS:-../shared/models}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# field NAME: of the last verdict
field() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$work/out/verdict.json"; }

# cells ORDER MOTION MODEL
cells() {
  sed "s/<horizon /<horizon order=\"$1\" /" "problems/motions/$2/problem.xml" >"$work/problem.xml"
  "$build/problems/cavort" solve "$work/problem.xml" --model "$3" -o "$work/out" --strategies 1 --threads 1 --quiet || true
  certified=no
  [ "$(field certified)" = true ] && certified=yes
  printf ' %s | %d | %s | %s |' "$certified" "$(field iterations)" \
    "$(field momentum_defect_rms | awk '{ printf "%.1e", 100 * $1 }')" \
    "$(field closed_loop_end_error_m | awk '{ printf "%.0f", 1000 * $1 }')"
}

# theft: what each order makes of a jump 2 m up
theft() {
  echo "| order | certified | cost | momentum defect, % | unactuated force | apex, of 2 m |"
  echo "|---|---|---|---|---|---|"
  for order in euler midpoint momentum; do
    sed "s/<horizon /<horizon order=\"$order\" /; s/target=\"0.3\"/target=\"2\"/; s/target=\"0.25\"/target=\"1.9\"/; s/apex=\"0.3\"/apex=\"2\"/" \
      problems/motions/jump/problem.xml >"$work/problem.xml"
    "$build/problems/cavort" solve "$work/problem.xml" --model problems/models/humanoid.xml -o "$work/out" --strategies 1 --threads 1 \
      --quiet || true
    printf '| %s | %s | %.1f | %.1f | %.1e | %s |\n' $order "$(field certified)" "$(field cost)" \
      "$(field momentum_defect_rms | awk '{ print 100 * $1 }')" "$(field unactuated_force_max)" \
      "$(awk -F, '$1 == "apex" { printf "%.2f", 2 - $7 }' "$work/out/terms.csv")"
  done
}
if [ "${2:-}" = theft ]; then
  theft
  exit 0
fi

# row MOTION MODEL NAME
row() {
  [ -f "$2" ] || return 0
  printf '| %s | %s |' "$1" "$3"
  cells midpoint "$1" "$2"
  cells momentum "$1" "$2"
  echo
}

{
  echo "# Motions by the order of the step"
  echo
  echo "\`sh tests/orders.sh\`: one solve each by the own solver from the stated guess, first under \`midpoint\`, then under \`momentum\`."
  echo "Momentum defect in percent of the weight, rms; error of the closed loop at its end in mm."
  echo
  echo "- compiler: $(cc --version | head -n 1)"
  echo "- commit: $(git rev-parse --short HEAD)"
  echo
  echo "| motion | model | midpoint: certified | iterations | defect, % | end, mm | momentum: certified | iterations | defect, % | end, mm |"
  echo "|---|---|---|---|---|---|---|---|---|---|"
  for motion in squat-jump jump kick reach walk step-up get-up-back get-up-front; do
    row $motion problems/models/humanoid.xml ours
    row $motion "$shared/mujoco/humanoid.xml" MuJoCo
    row $motion "$shared/dm_control/humanoid.xml" dm_control
  done
  row hopper-hop problems/models/hopper.xml hopper
  row walker-jump problems/models/walker.xml walker
  row cheetah-jump problems/models/cheetah.xml cheetah
} >"$work/orders.md"
awk -F'|' 'NF > 10 { a += $4 ~ /yes/; b += $8 ~ /yes/; i += $5; j += $9 }
  END { printf "\nTogether: midpoint %d certified, %d iterations; momentum %d certified, %d iterations.\n", a, i, b, j }' \
  "$work/orders.md" >>"$work/orders.md"
mv "$work/orders.md" tests/results/orders.md
cat tests/results/orders.md
