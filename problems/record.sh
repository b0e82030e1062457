#!/bin/sh
# Records what a motion's folder says to expect: solves it, and writes expected.json and picture.png beside problem.xml.
# Usage: sh problems/record.sh MOTION TIME [--model FILE]
# TIME is the moment of the picture, s. The tool is build/problems/cavort, or $CAVORT; the picture needs chromium.
set -eu
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n 's/^# Usage: /usage: /p' problems/record.sh >&2; exit 2; }
motion=$1
time=$2
shift 2
folder=problems/motions/$motion
result=$(mktemp -d)
trap 'rm -rf "$result"' EXIT

# times depend on the machine and are no expectation; targets are in the problem
"${CAVORT:-build/problems/cavort}" solve --quiet "$folder/problem.xml" -o "$result" --threads 1 "$@"
sed '/"solve_seconds"/d; /^  "targets": \[/,$d' "$result/verdict.json" | sed '$s/,$//' >"$folder/expected.json"
echo "}" >>"$folder/expected.json"

chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
  --ignore-gpu-blocklist --window-size=800,380 --virtual-time-budget=8000 --screenshot="$folder/picture.png" \
  "file://$result/view.html#t=$time" >"$result/chromium.log" 2>&1 || { cat "$result/chromium.log" >&2; exit 1; }
echo "$folder: expected.json and picture.png"
