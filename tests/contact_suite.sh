#!/bin/sh
# The contact suite: scenes of the literature, built anew, by this library and by MuJoCo in turns, beside what was published; then
# an hour of standing and ten minutes of dragging. Writes results/contact_suite.md, a minute or two. Usage: sh
# tests/contact_suite.sh [BUILD]   (folder of a release build, by default build)
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
table=tests/results/contact_suite.md
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ninja -C "$build" tests/contact_suite >/dev/null

# the hour and the ten minutes; all else at its full length. A failed check is told at the end
"$build/tests/contact_suite" rolling balls robot bodies hand chains humanoid laws standing:3600 dragging:600 \
  >"$work/rows" 2>"$work/failed" || true

{
  sed "s/@MACHINE@/$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) processors, one used/
    s/@COMPILER@/$(cc --version | head -n 1)/
    s/@COMMIT@/$(git rev-parse --short HEAD)$(git diff --quiet HEAD -- dynamics include || echo ' and changes')/" \
    tests/contact_suite/about.md
  echo
  grep '^- ' "$work/rows"
  grep 'checks, ' "$work/rows" | sed 's/^/- /; s/$/./'
  sed 's/^[^:]*tests\//- /' "$work/failed"
  echo
  echo "## Table"
  echo
  echo "| scene, error | engine | setting | step, ms | error | time, s | machine |"
  echo "|---|---|---|---|---|---|---|"
  grep '^|' "$work/rows"
} >"$work/table"
mv "$work/table" "$table"
sed -n '/^## Pareto/,/^## Table/p' "$table"
