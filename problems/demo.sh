#!/bin/sh
# From a fresh clone to a certified motion: sh problems/demo.sh [FOLDER]
# Installs what is missing, builds, solves "squat to stand, then jump" on the project's own humanoid and says where to look.
# FOLDER takes the result, by default results/squat-jump. The exit status is that of the solve: 0 certified and achieved, 1 not.
set -u
cd "$(dirname "$0")/.." || exit 1
out=${1:-results/squat-jump}
start=$(date +%s)

sh problems/install.sh build || exit 1

# the build is quiet unless it fails
echo "building ..."
log=$(mktemp)
{
  { [ -f build/build.ninja ] || meson setup build --buildtype=release -Dpeers=disabled -Dtests=false; } && meson compile -C build
} >"$log" 2>&1 || { cat "$log"; rm -f "$log"; exit 1; }
rm -f "$log"

build/problems/cavort solve problems/motions/squat-jump/problem.xml -o "$out"
status=$?

echo
if [ -f "$out/view.html" ]; then
  echo "open this page in a browser to see the motion: file://$(cd "$out" && pwd)/view.html"
fi
echo "everything took $(($(date +%s) - start)) s; the numbers are in $out/verdict.json"
exit "$status"
