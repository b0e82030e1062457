#!/bin/sh
# One page with all motions of some result folders moving: sh problems/gallery.sh OUT DIR...
# OUT gets index.html, of each folder NAME.webp, a moving picture, and NAME.html, its whole page. Needs node and chromium.
# The tool is build/problems/cavort, or $CAVORT; pages are written anew by it.
set -eu
[ $# -ge 2 ] || { sed -n 's/^# One page.*: \(sh .*\)/usage: \1/p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
cavort=${CAVORT:-$here/../build/problems/cavort}
out=$1
shift
mkdir -p "$out"
cards=$(mktemp)
trap 'rm -f "$cards"' EXIT

escape() { sed 's/&/\&amp;/g; s/</\&lt;/g; s/>/\&gt;/g; s/"/\&quot;/g'; }

for folder in "$@"; do
  name=$(basename "$(cd "$folder" && pwd)")
  "$cavort" view --quiet "$folder"
  cp "$folder/view.html" "$out/$name.html"
  node "$here/picture.mjs" "$out/$name.webp" "$out/$name.html" --size 360x270 --rate 15
  state="not certified"
  grep -q '"certified": true' "$folder/verdict.json" && state=certified
  label=$(printf '%s' "$name" | escape)
  printf '<a class="%s" href="%s.html"><img src="%s.webp" width="360" height="270" loading="lazy" alt="%s, moving"><b>%s</b><span>%s</span></a>\n' \
    "${state%% *}" "$label" "$label" "$label" "$label" "$state" >>"$cards"
done

{
  cat <<'HEAD'
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Motions</title>
<style>
:root { --panel: #fff; --ink: #171b21; --muted: #5b6573; --line: #dde2e8; --ground: #f4f6f9; --good: #157347; }
@media (prefers-color-scheme: dark) {
  :root { --panel: #1b2027; --ink: #e7ebf0; --muted: #97a2b1; --line: #2c343e; --ground: #14181d; --good: #4ac38b; }
}
body { margin: 0; padding: 28px 24px 48px; background: var(--ground); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0 auto 18px; max-width: 1180px; font-size: 22px; letter-spacing: -.01em; }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(250px, 1fr)); gap: 16px; max-width: 1180px; margin: auto; }
a {
  display: grid; grid-template-columns: 1fr auto; gap: 0 10px; padding-bottom: 10px; border: 1px solid var(--line); border-radius: 12px;
  overflow: hidden; background: var(--panel); color: inherit; text-decoration: none;
}
a:hover, a:focus-visible { border-color: var(--muted); }
img { grid-column: 1 / 3; width: 100%; height: auto; display: block; margin-bottom: 9px; }
b { padding-left: 14px; font-weight: 600; overflow-wrap: anywhere; }
span { padding-right: 14px; color: var(--muted); font-size: 13px; line-height: 23px; }
.certified span { color: var(--good); }
</style>
</head>
<body>
<h1>Motions</h1>
<main>
HEAD
  cat "$cards"
  printf '</main>\n</body>\n</html>\n'
} >"$out/index.html"
echo "open in a browser: file://$(cd "$out" && pwd)/index.html"
