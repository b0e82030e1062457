#!/bin/sh
# Makes the pages and tables of four scenes under tests/results anew: what accuracy costs (report-*, by cavort report)
# and where the numbers end (stress-*, cavort stress); then, of their tables and the contact suite's, the page of all
# (scenes: results/scenes.md) and the two plots of README.md (plots). Half an hour, most of it the solves of
# get-up-back. Usage: sh tests/pages.sh [NAME...], default all. CAVORT_BUILD names the folder of a release build, by
# default build. The shared models have to be in ../shared/models: the commands on the pages name them there.
set -eu
cd "$(dirname "$0")/.."

build=${CAVORT_BUILD:-build}
out=tests/results
pages="report-get-up-back report-humanoid report-quadruped report-g1 stress-humanoid stress-get-up stress-quadruped stress-g1"
names="$pages scenes plots"

# a page names the commit that the tool was built of, so that has to be all there is
build_tool() {
  git diff --quiet HEAD || { echo "pages.sh: commit what is changed first: a page names its commit" >&2; exit 1; }
  ninja -C "$build" problems/cavort >/dev/null
}

# scene of a page: a file of this tree or of the shared models beside it
scene() {
  case ${1#*-} in
    humanoid) echo problems/models/humanoid.xml ;;
    get-up | get-up-back) echo problems/motions/get-up-back/problem.xml ;;
    quadruped) echo ../shared/models/dm_control/quadruped.xml ;;
    g1) echo ../shared/models/unitree/g1/scene_29dof.xml ;;
  esac
}

# a page and its tables, in place of the former; a page stays below 300 kB
page() {
  folder=$out/$1 command=report threads=
  case $1 in stress-*) folder=$out/stress/${1#stress-} command=stress threads='--threads 1' ;; esac
  # status 1: the scene is not well at its own values, which its page says
  # shellcheck disable=SC2086
  "$build/problems/cavort" "$command" "$(scene "$1")" -o "$folder" $threads --quiet || [ "$command $?" = "stress 1" ]
  [ "$(wc -c <"$folder/$command.html")" -le 300000 ] || { echo "pages.sh: $folder/$command.html is beyond 300 kB" >&2; exit 1; }
}

# what the report of a scene says under a heading of its advice
advice() { sed -n "s/&#39;/'/g; s|^<dt>$2</dt><dd>\(.*\)</dd>\$|\1|p" "$out/report-$1/report.html"; }

# rows of a table of what a motion costs: wanted error | order, step: time (error)
costs() {
  sed -n '/What accuracy costs: the cheapest/,/<\/table>/p' "$out/report-$1/report.html" |
    sed -n 's/^<tr[^>]*>//; s/<td[^>]*>//g; s/<\/td><\/tr>$//; s/<\/td>/|/gp' | grep '^[0-9]' |
    awk -F'|' '{ printf "%s", $4 + 0 ? " " $3 ", " 1e3 * $4 " ms: " $5 " ms |" : " no step tried |" }'
}

# ranges of stress side by side, in the order of the scenes
ranges() {
  for scene in humanoid get-up quadruped g1; do
    sed "1d; s/^/$scene,/" "$out/stress/$scene/ranges.csv"
  done | awk -F, '
    function n(x) { return sprintf("%.2g", x) }
    !($2 in unit) { unit[$2] = $3; order[++count] = $2 }
    { cell[$2, $1] = ($5 == "" ? "not at its own " n($4) : n($5) " to " n($6) " (" n($4) ")") ($7 $8 == "" ? "" : "; breaks at" \
        ($7 == "" ? "" : " " n($7)) ($7 == "" || $8 == "" ? "" : ",") ($8 == "" ? "" : " " n($8))) }
    END {
      for (i = 1; i <= count; i++) {
        p = order[i]
        printf "| %s, %s | %s | %s ", p, unit[p], cell[p, "humanoid"], cell[p, "get-up"]
        printf "| %s | %s |\n", cell[p, "quadruped"], cell[p, "g1"]
      }
    }'
}

# what lies within a factor of ten of a scene's own values, with the reason; of a scene that is not well there, that
near() {
  sed 1d "$out/stress/$1/ranges.csv" | awk -F, '
    function unquoted(x) { gsub(/^"|"$/, "", x); return x }
    {
      rest = $0
      for (i = 0; i < 7; i++) sub(/^[^,]*,/, "", rest)
      if (rest ~ /^"/) { match(rest, /^"[^"]*"/) } else match(rest, /^[^,]*/)
      below = unquoted(substr(rest, 1, RLENGTH)); above = unquoted(substr(rest, RLENGTH + 2))
      if ($4 == "") { if (!ill++) print "- Not well at its own values: " below "."; next }
      if ($3 > 0 && $4 > 0 && below != "" && $3 <= 10 * $4) printf "- %s below %.2g (its own %.2g): %s.\n", $1, $4, $3, below
      if ($3 > 0 && above != "" && $5 <= 10 * $3) printf "- %s above %.2g (its own %.2g): %s.\n", $1, $5, $3, above
    }'
}

# solves of a problem as a table: the first to a feasible motion is seldom the one to use
solves() {
  [ -f "$out/report-$1/plan.csv" ] || return 0
  echo
  echo "| solver | order, step | processor time | cost | of which may be saved, at most | feasible |"
  echo "|---|---|---|---|---|---|"
  sed '1d; s/, /;/; s/"//g' "$out/report-$1/plan.csv" | awk -F, '{
    sub(/;/, ", ", $1)
    printf "| %s | %s, %g ms | %.3g s | %.3g ", $1, $2, 1e3 * $5, $6, $8
    printf "| %s | %s |\n", $11 == "" ? "" : sprintf("%.2g", $11), $12 == 1 ? "yes" : "no"
  }'
  echo
  echo "Where several are feasible, weigh cost against time: the first may still waste most of its cost."
}

# the commit that a page names
commit() { sed -n 's|^<dt>commit</dt><dd> *\(.*\)</dd>$|\1|p' "$1"; }

scenes() {
  {
    cat <<'TEXT'
# Four scenes: what to use, and where it ends

Which step, order, tolerance and solver a scene needs for an error, and how far its numbers hold. `sh tests/pages.sh scenes`
writes this page from the pages and tables beside it, which `sh tests/pages.sh` makes anew: `report-*` by `cavort report`
(error against run time), `stress/*` by `cavort stress` (safe ranges). Errors and ranges are the same in every run of one
build; times are processor time of one thread on one machine, which each page names with compiler, commit, command and
load. For a scene of your own run these two commands.

## What to use

A motion of 0.32 s, once without contacts and once with: the cheapest order and step that ends within a fraction of
the largest way of a coordinate, as order, step: processor time of the motion. *No step tried*: none of the steps
measured, down to 0.16 ms where the time allowed it, came that near. Contacts are made and lost within a step, so with
them a higher order gains little. Under each scene stands what its report advises, and the edges that are near.

![error against time of the humanoid, three orders of the step](accuracy.svg)

TEXT
    echo "| scene | 10 % | 1 % | 0.1 % | 0.01 % | pages |"
    echo "|---|---|---|---|---|---|"
    for pair in humanoid:humanoid get-up-back:get-up quadruped:quadruped g1:g1; do
      report=${pair%:*} stress=${pair#*:}
      echo "| $report |$(costs "$report" | cut -d'|' -f1-4)|" \
        "[report](report-$report/report.html), [stress](stress/$stress/stress.html) |"
    done
    for pair in humanoid:humanoid get-up-back:get-up quadruped:quadruped g1:g1; do
      report=${pair%:*} stress=${pair#*:}
      echo
      echo "### $report"
      echo
      echo "\`$(scene "report-$report")\`: $(advice "$report" Scene)"
      echo
      for term in "Step and order" "Forward solver and tolerance" "Forward to rounding" Derivatives "Solver of the problem"; do
        said=$(advice "$report" "$term")
        [ -z "$said" ] || echo "- **$term.** $said"
      done
      solves "$report"
      echo
      echo "Edges within a factor of ten of its own values:"
      echo
      edges=$(near "$stress")
      echo "${edges:-- None.}"
      echo
      echo "Commits: report $(commit "$out/report-$report/report.html"), stress $(commit "$out/stress/$stress/stress.html")."
    done
    cat <<'TEXT'

## Where numbers hold

Safe range of each parameter, in brackets the scene's own value, then the first values that break. Safe:
forward(inverse(v')) misses v' by 1e-10 at most, derivatives agree with differences to 1e-5, every forward step
converges, and a passive run gains at most a tenth of its energy. Beyond its range a scene degrades before it breaks; a
range without such a value goes as far as the sweep, or degrades only. A scene that is *not* well at its own value has
no safe range. Safe is not exact: what a step costs in error is the table above.

| parameter | humanoid | get-up | quadruped | g1 |
|---|---|---|---|---|
TEXT
    ranges
    cat <<'TEXT'

## Contacts beside other engines

Two scenes that others published have an error whose truth is known, and times; `sh tests/contact_suite.sh` runs them,
MuJoCo by turns. Published times are of another machine (i7-7700HQ, 2018), so times compare as to their order only.
[contact_suite.md](contact_suite.md) has all rows and scenes, those where others are ahead among them.

![error against time of rolling and of dropped balls](contacts.svg)

TEXT
    sed -n '/^## Pareto/,/^## Table/s/^- \(.* points .*\)/- \1/p' "$out/contact_suite.md"
  } >"$out/scenes.tmp"
  mv "$out/scenes.tmp" "$out/scenes.md"
}

# points of a motion and an order: time, error
points() { awk -F, -v m="\"$1\"" -v o="\"$2\"" '$1 == m && $2 == o { print $4, $7 }' "$out/report-humanoid/step.csv"; }

# points of an engine on a scene of the contact suite: time, error, one a step
suite() {
  awk -F' *[|] *' -v scene="$1" -v engine="$2" -v setting="$3" '$2 == scene && $3 == engine && $4 == setting { print $7, $6 }' \
    "$out/contact_suite.md" | sort -g
}

# the two plots of README.md, of the tables that are there
plots() {
  command -v gnuplot >/dev/null || { echo "gnuplot is missing: apt-get install gnuplot-nox" >&2; exit 1; }
  data=$(mktemp -d)
  for motion in free contacts; do
    for order in euler midpoint momentum; do points $motion $order >"$data/$motion-$order"; done
  done
  i=0
  for case in "rolling balls, (m/s)²" "6³ balls, m²"; do
    i=$((i + 1))
    own="discrete, κ 0.1 s, ε 1e-4, Coulomb" theirs="Newton, elliptic, solref 0.1 1, solimp 0.9"
    [ $i = 1 ] || own="discrete, κ 0, ε 1e-4" theirs=Newton
    suite "$case" cavort "$own" >"$data/$i-cavort"
    suite "$case" "MuJoCo 2.2.2" "$theirs" >"$data/$i-mujoco"
    suite "$case" RaiSim published >"$data/$i-raisim"
    suite "$case" "Bullet, multibody" published >"$data/$i-bullet"
    suite "$case" "ODE, quick" published >"$data/$i-ode"
    suite "$case" "MuJoCo 1.5, Newton" published >"$data/$i-mujoco15"
  done
  for file in "$data"/*; do [ -s "$file" ] || { echo "pages.sh: no points for ${file##*/}" >&2; exit 1; }; done
  style='set grid lc "#dddddd"
set logscale xy
set format x "10^{%L}"
set format y "10^{%L}"'
  gnuplot <<PLOT
set terminal svg size 900,400 font "sans,13" background "white"
set output "$data/accuracy.svg"
set multiplot layout 1,2
$style
colours = "#1f5fa8 #b22222 #2e8b57"
set key left bottom Left reverse
set xlabel "time of the motion, ms"
set ylabel "error at its end, m or rad"
set title "humanoid, 0.32 s without contacts"
plot for [i=1:3] "$data/free-".word("euler midpoint momentum", i) with linespoints pt 7 ps 0.6 lw 2 lc rgb word(colours, i) \
  title word("euler midpoint momentum", i)
set title "the same with contacts"
plot for [i=1:3] "$data/contacts-".word("euler midpoint momentum", i) with linespoints pt 7 ps 0.6 lw 2 lc rgb word(colours, i) \
  title word("euler midpoint momentum", i)
PLOT
  gnuplot <<PLOT
set terminal svg size 900,440 font "sans,13" background "white"
set output "$data/contacts.svg"
set multiplot
$style
names = "cavort mujoco mujoco15 raisim bullet ode"
titles = '"cavort, here" "MuJoCo 2.2.2, here" "MuJoCo 1.5, published" "RaiSim, published" "Bullet, published" "ODE, published"'
colours = "black #1f5fa8 #1f5fa8 #b22222 #2e8b57 #ff8c00"
set xlabel "time, s"
set key off
set size 0.5,0.86
set origin 0,0.14
set title "rolling balls, steps of 40, 10 and 1 ms"
set ylabel "mean squared error of velocity, (m/s)²"
set yrange [1e-10:1e2]
plot for [i=1:6] "$data/1-".word(names, i) with linespoints pt (i < 3 ? 7 : 6) ps 0.8 lw (i < 3 ? 2 : 1) lc rgb word(colours, i)
set origin 0.5,0.14
set title "6³ balls dropped, the same steps"
set ylabel "squared penetration, m²"
set yrange [1e-16:1e2]
plot for [i=1:6] "$data/2-".word(names, i) with linespoints pt (i < 3 ? 7 : 6) ps 0.8 lw (i < 3 ? 2 : 1) lc rgb word(colours, i)
set origin 0.05,0
set size 0.9,0.15
set margins 1,1,0,0
unset logscale
unset border
unset tics
unset grid
unset xlabel
unset ylabel
unset title
set xrange [0:1]
set yrange [0:1]
set key center center maxrows 2 Left reverse
plot for [i=1:6] -1 with linespoints pt (i < 3 ? 7 : 6) ps 0.8 lw (i < 3 ? 2 : 1) lc rgb word(colours, i) title word(titles, i)
PLOT
  # titles of curves name the file of the data
  for plot in accuracy contacts; do sed "s#$data/##g" "$data/$plot.svg" >"$out/$plot.svg"; done
  rm -r "$data"
}

# shellcheck disable=SC2086
[ $# -gt 0 ] || set -- $names
for name; do
  case " $names " in *" $name "*) ;; *) echo "usage: sh tests/pages.sh [NAME...], of: $names" >&2 && exit 2 ;; esac
done
case " $* " in *" report-"* | *" stress-"*) build_tool ;; esac
for name; do
  case $name in
    report-* | stress-*) page "$name" ;;
    *) "$name" ;;
  esac
done
