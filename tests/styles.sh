#!/bin/sh
# What ready sets of costs do to seven quick motions: sh tests/styles.sh [BUILD] writes results/styles.md.
# CAVORT_RESULTS=DIR keeps the result folders as DIR/MOTION-STYLE, and takes those that are there already.
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
work=${CAVORT_RESULTS:-$(mktemp -d)}
[ -n "${CAVORT_RESULTS:-}" ] || trap 'rm -rf "$work"' EXIT
mkdir -p "$work"

# solved MOTION STYLE
solved() {
  out=$work/$1-$2
  [ ! -f "$out/verdict.json" ] || return 0
  set -- "problems/motions/$1/problem.xml" "$2"
  if [ "$2" = none ]; then
    "$build/problems/cavort" solve "$1" --threads 1 --strategies 1 --quiet -o "$out" || true
  else
    "$build/problems/cavort" solve "$1" --set cost/style/@name="$2" --threads 1 --strategies 1 --quiet -o "$out" || true
  fi
}

# field NAME: of the verdict
field() { sed -n "s/^ *\"$1\": \([^,]*\),*$/\1/p" "$out/verdict.json"; }

# measure NAME FORMAT: of cavort quality
measure() { awk -F , -v n="$1" -v f="$2" '$1 == n { if ($4 == "") print "-"; else printf f, $4 }' "$work/quality.csv"; }

{
  echo "# Styles"
  echo
  echo "\`sh tests/styles.sh\`: seven motions as they are, and with \`<style name=\"careful\"/>\` and \`\"athletic\"\` among their costs; own solver, stated guess, one thread. The measures are those of \`cavort quality\`. Solved at $(git rev-parse --short HEAD)."
  echo
  echo "| motion | style | certified | achieved | iterations | jerk, m/s³ | effort, % | landing, weights | flailing, m/s | asymmetry, % | push survived, N s |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|"
  for motion in quadruped-jump walker-walk robot-squat walk-cycle robot-jump squat-jump kick; do
    for style in none careful athletic; do
      solved $motion $style
      "$build/problems/cavort" quality "$out" --csv >"$work/quality.csv"
      printf '| %s | %s | %s | %s | %s | %s | %s | %s | %s | %s | %.1f |\n' $motion $style "$(field certified | sed 's/true/yes/; s/false/no/')" \
        "$(field achieved | sed 's/true/yes/; s/false/no/')" "$(field iterations)" "$(measure jerk %.0f)" "$(measure effort %.1f)" \
        "$(measure landing %.2f)" "$(measure flailing %.2f)" "$(measure asymmetry %.0f)" "$(field push_survived_n_s | sed 's/null/0/')"
    done
  done
} >"$work/styles.md"
mv "$work/styles.md" tests/results/styles.md
