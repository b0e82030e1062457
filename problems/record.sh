#!/bin/sh
# Records what a motion's folder says to expect: solves it, and writes expected.json and picture.webp beside problem.xml.
# Usage: sh problems/record.sh MOTION [--model FILE]
# The tool is build/problems/cavort, or $CAVORT; the picture, which moves, needs node and chromium.
set -eu
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n 's/^# Usage: /usage: /p' problems/record.sh >&2; exit 2; }
motion=$1
shift
folder=problems/motions/$motion
result=$(mktemp -d)
trap 'rm -rf "$result"' EXIT

# times depend on the machine and are no expectation; targets are in the problem
"${CAVORT:-build/problems/cavort}" solve --quiet "$folder/problem.xml" -o "$result" --threads 1 "$@"
sed '/"solve_seconds"/d; /^  "targets": \[/,$d' "$result/verdict.json" | sed '$s/,$//' >"$folder/expected.json"
echo "}" >>"$folder/expected.json"
node problems/picture.mjs "$folder/picture.webp" "$result/view.html" --size 400x300 --rate 15
echo "$folder: expected.json and picture.webp"
