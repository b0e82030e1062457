#!/bin/sh
# Solves the problems of tests/unseen and problems/examples, each stated in minutes and not tuned, as anyone would, and writes results/unseen.md: whether it is
# certified and achieved, by which strategy, what all of them took, one thread each, and from how many of eight starts that are a
# little off MuJoCo follows it (build/tests/bench_replay, where that was built). Problems whose models are not there are left out.
# Each is stopped after $SECONDS_EACH s, by default 300.
# Usage: sh tests/unseen.sh [BUILD [NAME...]]   (folder of a release build, by default build; with names only these, printed and not written)
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
[ $# -eq 0 ] || shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
all=
[ $# -gt 0 ] || { all=1; for f in tests/unseen/*.xml problems/examples/*.xml; do set -- "$@" "$(basename "$f" .xml)"; done; }

# field NAME: of the last verdict
field() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$work/$name/verdict.json"; }

# how many starts of a certified motion MuJoCo follows
follows() {
  [ -x "$build/tests/bench_replay" ] && [ "$(field certified)" = true ] || { echo -; return; }
  # a file that its version of MuJoCo cannot read has no line
  "$build/tests/bench_replay" apart "$work/$name" 2>"$work/log" | awk -F '|' '{ gsub(/^ +| +$/, "", $8); n = $8 } END { print n == "" ? "-" : n }'
}

row() {
  name=$1 folder=tests/unseen
  [ -f "$folder/$name.xml" ] || folder=problems/examples
  [ -f "$folder/$(sed -n 's/^<problem .*model="\([^"]*\)".*/\1/p' "$folder/$name.xml")" ] || return 0
  timeout -s INT "${SECONDS_EACH:-300}" "$build/problems/cavort" solve "$folder/$name.xml" -o "$work/$name" --threads 1 --quiet >"$work/log" 2>&1 || true
  [ -f "$work/$name/verdict.json" ] || { echo "| $name | no result: $(tail -1 "$work/log") |"; return; }
  kept=$(awk -F , 'NR > 1 && $2 == 1 { print $1 }' "$work/$name/strategies.csv")
  spent=$(awk -F , 'NR > 1 && $6 != "" { s += $6; n++ } END { printf "%d | %.0f", n, s }' "$work/$name/strategies.csv")
  echo "$name $(field certified) $(field achieved) $(field cost) $(field optimality) $(field duration) $kept" | awk -v spent="$spent" -v follows="$(follows)" '
    { printf "| %s | %g | %s | %s | %.4g | %.0e | %s | %s | %s |\n", $1, $6, $2 == "true" ? "yes" : "no", $3 == "true" ? "yes" : "no", $4, $5, $7, spent, follows }'
}

table() {
  echo "| problem | s | certified | achieved | cost | optimal to | kept | strategies | s, all of them | MuJoCo follows |"
  echo "|---|---|---|---|---|---|---|---|---|---|"
  for one in "$@"; do row "$one"; done
}

if [ "$all" ]; then
  {
    printf '# Problems that were not tuned\n\n`sh tests/unseen.sh`: the files of tests/unseen and problems/examples, each stated in minutes, start and goal and what is asked; solved by all strategies, one thread, stopped after 300 s. Debian'\''s MuJoCo cannot read Go1'\''s file.\n\n'
    printf -- '- machine: %s\n- commit: %s\n\n' "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)" "$(git rev-parse --short HEAD)"
    table "$@"
  } >"$work/unseen.md"
  mv "$work/unseen.md" tests/results/unseen.md
  cat tests/results/unseen.md
else
  table "$@"
fi
