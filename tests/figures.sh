#!/bin/sh
# Draws the paper's figures 2 and 3 from our own runs into tests/results, each with a table that names machine, compiler and
# commit. Usage: sh tests/figures.sh [2|3], default both. Needs gnuplot; CAVORT_BUILD names a build folder, by default build.
set -eu
cd "$(dirname "$0")/.."

build=${CAVORT_BUILD:-build}
out=tests/results
data=$(mktemp -d)
trap 'rm -rf "$data"' EXIT
command -v gnuplot >/dev/null || { echo "gnuplot is missing: apt-get install gnuplot-nox" >&2; exit 1; }
[ -d "$build" ] || meson setup "$build" .

# provenance: where the numbers come from
provenance() {
  echo "$1"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) cores"
  echo "compiler  $(${CC:-cc} --version | head -n 1), $(meson introspect "$build" --buildoptions |
    sed 's/}, *{/}\n{/g' | sed -n 's/.*"name": "buildtype", "value": "\([^"]*\)".*/\1/p')"
  echo "commit    $(git rev-parse --short HEAD)$(git diff --quiet HEAD -- dynamics include || echo ' and changes')"
  echo
}

figure2() {
  ninja -C "$build" tests/test_joint >/dev/null
  { provenance "sh tests/figures.sh 2" && "$build/tests/test_joint" "$data/joint"; } >"$out/figure2.txt"
  gnuplot <<END
set terminal svg size 900,640 font "sans,13" background "white"
set output "$out/figure2.svg"
set lmargin 11
set multiplot layout 3,1 title "Single joint under random control: forward (black), inverse (orange)"
set xrange [0:2]
set key off
set grid ytics lc "#dddddd"
set ylabel "friction, mN m s"
plot "$data/joint" using 1:(1e3*\$4) with lines lw 4 lc "black", "" using 1:(1e3*\$5) with lines lw 1.5 lc "#ff8c00"
set ylabel "contact, N s"
plot "$data/joint" using 1:6 with lines lw 4 lc "black", "" using 1:7 with lines lw 1.5 lc "#ff8c00"
set ylabel "limit, N m s"
set xlabel "time, s"
plot "$data/joint" using 1:8 with lines lw 4 lc "black", "" using 1:9 with lines lw 1.5 lc "#ff8c00"
END
  # titles of curves name the file of the data
  sed -i "s#\"$data/#\"#" "$out/figure2.svg"
}

figure3() {
  ninja -C "$build" tests/bench_forward >/dev/null
  { provenance "sh tests/figures.sh 3" && "$build/tests/bench_forward" "$data/speed"; } >"$out/figure3.txt"
  gnuplot <<END
set terminal svg size 1000,440 font "sans,13" background "white"
set output "$out/figure3.svg"
set multiplot layout 1,2
set xrange [0:*]
set yrange [0:*]
set xlabel "size of contact Jacobian"
set grid lc "#dddddd"
set key left top
set ylabel "CPU time per step, microseconds"
plot "$data/speed" using 1:5 with linespoints pt 7 ps 0.4 lw 2 lc "#b22222" title "forward(50)", \
  "" using 1:4 with linespoints pt 7 ps 0.4 lw 2 lc "#1f5fa8" title "forward(5)", \
  "" using 1:6 with linespoints pt 7 ps 0.4 lw 2 lc "#2e8b57" title "Newton, converged", \
  "" using 1:3 with linespoints pt 7 ps 0.4 lw 2 lc "black" title "inverse"
set ylabel "speed-up factor"
plot "$data/speed" using 1:8 with linespoints pt 7 ps 0.4 lw 2 lc "#b22222" title "forward(50) / inverse", \
  "" using 1:7 with linespoints pt 7 ps 0.4 lw 2 lc "#1f5fa8" title "forward(5) / inverse"
END
}

case ${1:-all} in
  2) figure2 ;;
  3) figure3 ;;
  all) figure2 && figure3 ;;
  *) echo "usage: sh tests/figures.sh [2|3]" >&2 && exit 2 ;;
esac
