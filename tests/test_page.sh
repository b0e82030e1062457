#!/bin/sh
# The page of a result in headless Chromium, by clicks and keys: tests/test_page.mjs on motions that are solved here.
# Usage: test_page.sh CAVORT SOURCE_ROOT. Skipped, with a word, where node, chromium or three.js is missing.
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$2
skip() {
  echo "skipped: $1 is not installed, the page is not opened"
  exit 77
}
command -v node >/dev/null || skip node
command -v "${CHROMIUM:-chromium}" >/dev/null || skip chromium
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

"$cavort" view --quiet "$root/problems/motions/squat-jump/problem.xml" 2>err || {
  grep -q "cannot read three.js" err && skip three.js
  cat err
  exit 1
}
# a trot, and the same over less ground
"$cavort" solve --quiet --threads 1 "$root/problems/motions/quadruped-trot/problem.xml" -o far || exit 1
sed "s#\.\./\.\./models#$root/problems/models#; s/translation=\"[0-9.]*/translation=\"0.1/" \
  "$root/problems/motions/quadruped-trot/problem.xml" >near.xml
"$cavort" solve --quiet --threads 1 near.xml -o near || exit 1
"$cavort" view --quiet far near || exit 1
node "$root/problems/picture.mjs" moving.webp far/view.html near/view.html --size 160x120 --rate 10 >out || { cat out; exit 1; }
CAVORT=$cavort sh "$root/problems/gallery.sh" all near >out || { cat out; exit 1; }
timeout 250 node "$root/tests/test_page.mjs" "$work" "$root"
