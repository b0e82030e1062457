#!/bin/sh
# Writes the tables of tests/results anew, each with machine, compiler and commit. Usage: sh tests/results.sh [NAME...], default
# all of: inverse (time against MuJoCo, needs it and the shared models), heap (forward steps of heaps against MuJoCo), newton (those of robots), update (updates
# of their factors against new ones), normal (normal
# equations by bands, by groups of trees and by CHOLMOD), unused (what a plan pays for things out of its reach), sweep (broad phase), mesh (collision meshes of a robot at each stage), conservation (drift of energy and
# momentum), orders (error of the forces of the orders of the step, and what an evaluation costs), absent (what features cost where a scene has none of
# them), iteration (an iteration of the solver by this build and by one before its loops went by vectors), warm (a changed weight solved again, an iteration by itself), optimum (optimal control against known optima), methods (own solver and Ipopt on the same),
# stiff (forward steps at softness 1e-2 to 1e-14 against quadruple precision), sensors, tendons, actuation, fluid (readings, strings, drives and
# drag against MuJoCo's), interruption (solves killed and interrupted at random moments, half an hour), batch (200 problems, four of which go
# wrong), walk (forces of a recorded walk against force plates, needs the shared data).
# CAVORT_BUILD names a build folder, by default build.
set -eu
cd "$(dirname "$0")/.."

build=${CAVORT_BUILD:-build}
out=tests/results
[ -d "$build" ] || meson setup "$build" .

# a build before spatial tendons, equality constraints, fluids and further sensors and actuators were there
before=a83d729

provenance() {
  echo "$1"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) cores"
  echo "compiler  $(${CC:-cc} --version | head -n 1), $(meson introspect "$build" --buildoptions |
    sed 's/}, *{/}\n{/g' | sed -n 's/.*"name": "buildtype", "value": "\([^"]*\)".*/\1/p')"
  echo "commit    $(git rev-parse --short HEAD)$(git diff --quiet HEAD -- dynamics include || echo ' and changes')"
  echo
}

# run NAME PROGRAM ARGUMENT...: what a program of the tests prints, with its provenance; only whole files are left
run() {
  name=$1 program=$2
  shift 2
  ninja -C "$build" "tests/$program" >/dev/null
  { provenance "sh tests/results.sh $name" && "$build/tests/$program" "$@"; } >"$out/$name.tmp"
  sed "s|$PWD/||; s|${CAVORT_SHARED_MODELS:-$PWD/../shared/models}|../shared/models|" "$out/$name.tmp" >"$out/$name.txt"
  rm "$out/$name.tmp"
}

# Unitree G1 as shipped, and with a capsule fitted to each mesh that may touch
mesh() {
  robot=${CAVORT_SHARED_MODELS:-$PWD/../shared/models}/unitree/g1
  fitted=$(mktemp -d)
  sed 's/type="mesh" rgba/type="capsule" rgba/' "$robot/g1_29dof.xml" >"$fitted/g1_29dof.xml"
  cp "$robot/scene_29dof.xml" "$fitted"
  ln -s "$robot/meshes" "$fitted/meshes"
  run mesh bench_mesh "$robot/scene_29dof.xml" "$fitted/scene_29dof.xml"
  rm -r "$fitted"
}

# times and bits of the normal equations
normal() { run normal bench_normal; }

# a humanoid's file with all that a scene can have and leave out: a mesh and a height field that are only seen, a constraint that
# is switched off
declare_unused() {
  sed 's|^  </worldbody>|<geom type="mesh" mesh="unused" contype="0" conaffinity="0"/>\
<geom type="hfield" hfield="unused" contype="0" conaffinity="0"/></worldbody>\
<asset><mesh name="unused" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/><hfield name="unused" nrow="9" ncol="9" size="1 1 1 1"/></asset>\
<equality><joint joint1="elbow_left" joint2="elbow_right" active="false"/></equality>|' problems/models/humanoid.xml
}

# times of the humanoid's inverse by the build before, by this one, and by this one with what is left out in the file, by turns
absent() {
  old=$(mktemp -d)
  trap 'git worktree remove --force "$old/tree"; rm -rf "$old"' EXIT
  git worktree add --quiet --detach "$old/tree" "$before"
  meson setup "$old/build" "$old/tree" >/dev/null
  ninja -C "$old/build" tests/bench_inverse >/dev/null
  ninja -C "$build" tests/bench_inverse problems/cavort >/dev/null
  declare_unused >"$old/declared.xml"
  for turn in 1 2 3 4 5 6 7 8 9; do
    for when in before now declared; do
      tool=$build model=problems/models/humanoid.xml
      [ $when = before ] && tool=$old/build
      [ $when = declared ] && model=$old/declared.xml
      "$tool/tests/bench_inverse" "$model" | sed -n "s/^ *\([0-9]*\) - .* us *\([0-9.]*\) us .*us .*/\1 $when \2/p"
    done
  done >"$old/times"
  {
    provenance "sh tests/results.sh absent"
    echo "Inverse of problems/models/humanoid.xml, which has no tendon, equality constraint, fluid, sensor, mesh or height field: us,"
    echo "least and median of nine runs by turns, of a build before all of those were there ($before), of this build, and of this"
    echo "build with a mesh and a height field that are only seen and an equality constraint that is switched off in the file."
    echo
    echo "rows from  before: least, median  now: least, median  declared: least, median  ratio of the least: now, declared"
    for rows in 0 1 11 21 31 41 51 61; do
      for when in before now declared; do
        sed -n "s/^$rows $when //p" "$old/times" | sort -n | sed -n '1p;5p' | tr '\n' ' '
      done | awk -v rows="$rows" \
        '{ printf "%9d  %13.2f %7.2f  %10.2f %7.2f  %15.2f %7.2f  %25.3f %9.3f\n", rows, $1, $2, $3, $4, $5, $6, $3 / $1, $5 / $1 }'
    done
    echo
    for when in now declared; do
      model=problems/models/humanoid.xml
      [ $when = declared ] && model=$old/declared.xml
      echo "Memory of a state, cavort inspect: $when"
      "$build/problems/cavort" inspect "$model" --all | sed -n '/memory of a state/,/the whole/p' | sed 1d
    done
  } >"$out/absent.txt"
}

# forward steps of robots against MuJoCo's, which before its third version does not know limits of force in joints, which neither
# solver needs, and takes a range for a limit when told
newton() {
  robot=${CAVORT_SHARED_MODELS:-$PWD/../shared/models}/unitree/g1
  plain=$(mktemp -d)
  for file in scene_29dof g1_29dof; do
    sed 's/ actuatorfrc[a-z]*="[^"]*"//g; s/<jointactuatorfrc [^>]*>//g; s/<compiler /<compiler autolimits="true" /' "$robot/$file.xml" >"$plain/$file.xml"
  done
  ln -s "$robot/meshes" "$plain/meshes"
  run newton bench_heap problems/models/robot.xml problems/models/humanoid.xml "$plain/scene_29dof.xml"
  sed -i "s|$plain|unitree/g1|" "$out/newton.txt"
  rm -r "$plain"
}

# a build before factors left out what blocks end before and dofs, contacts and rows went four at a time; the benchmark that still
# builds with it, whose whole iterations are those of today's
before_vectors=dbd3df8 bench_vectors=ac07667

# least of three runs by turns of each build: ms and million instructions of a whole iteration, ms of a linearisation with its factor
iteration() {
  old=$(mktemp -d)
  trap 'git worktree remove --force "$old/tree"; rm -rf "$old"' EXIT
  git worktree add --quiet --detach "$old/tree" "$before_vectors"
  git show "$bench_vectors:tests/bench_iteration.c" >"$old/tree/tests/bench_iteration.c"
  meson setup "$old/build" "$old/tree" >/dev/null
  ninja -C "$old/build" tests/bench_iteration >/dev/null
  ninja -C "$build" tests/bench_iteration >/dev/null
  for turn in 1 2 3; do
    for motion in squat-jump walk; do
      for when in before now; do
        tool=$build
        [ $when = before ] && tool=$old/build
        "$tool/tests/bench_iteration" "problems/motions/$motion/problem.xml" |
          awk -v of="$motion $when" '/whole iterations/ { print of, $1, "whole", $6; print of, $1, "count", $8 }
            / stage$/ { stage = $1 } / analytic / { print of, stage, "linear", $(NF - 1) }'
      done
    done
  done >"$old/times"
  {
    provenance "sh tests/results.sh iteration"
    echo "Our humanoid at 40 knots, one thread, before ($before_vectors) and now: least of three runs by turns. Whole iterations of the trust"
    echo "region with their trials, ten each in three stages; a linearisation with its factor at a motion shaken by 0.02 rad."
    echo
    echo "motion      stage   iteration, ms: before    now  ratio  millions of instructions: before    now  ratio  linearised, ms: before    now  ratio"
    awk '{ key = $1 " " $3 " " $4 " " $2; if (!(key in least) || $5 < least[key]) least[key] = $5 }
      END { for (m = 1; m <= 2; m++) for (s = 1; s <= 3; s++) {
        motion = m == 1 ? "squat-jump" : "walk"; stage = s == 1 ? "first" : s == 2 ? "middle" : "last"; line = sprintf("%-10s  %-6s", motion, stage)
        for (w = 1; w <= 3; w++) { what = w == 1 ? "whole" : w == 2 ? "count" : "linear"
          b = least[motion " " stage " " what " before"]; n = least[motion " " stage " " what " now"]
          line = line sprintf(w == 1 ? "  %21.2f %6.2f %6.3f" : w == 2 ? "  %33.1f %6.1f %6.3f" : "  %22.2f %6.2f %6.3f", b, n, n / b) }
        gsub("nan", "  -", line); print line } }' "$old/times"
    ! grep -q nan "$old/times" || printf '\n-: no instructions are counted on this machine\n'
  } >"$out/iteration.txt"
}

# errors of the own solver on problems whose optima are known, on four grids each
optimum() {
  ninja -C "$build" tests/test_optimum >/dev/null
  {
    echo "# Optimal control with known optima"
    echo
    provenance "\`sh tests/results.sh optimum\`: errors relative to the truth (tests/optimum); iterations in all, the most in one stage, and after the last stage" |
      sed '/^$/d; s/^machine/\n- machine/; s/^compiler/- compiler/; s/^commit/- commit/'
    echo
    echo "## Own solver"
    echo
    "$build/tests/test_optimum" table | grep '^|'
    echo
    echo "## Ipopt"
    echo
    "$build/tests/test_optimum" ipopt table | grep '^|'
  } >"$out/optimum.tmp"
  mv "$out/optimum.tmp" "$out/optimum.md"
}

# the same problems on one grid by the own solver and by Ipopt with each Hessian
methods() {
  ninja -C "$build" tests/test_optimum >/dev/null
  {
    echo "# Methods on problems with known optima"
    echo
    provenance "\`sh tests/results.sh methods\`: each problem of tests/optimum on the second grid of its decade; cost off: relative to the truth, which the step bounds from below; seconds of one processor" |
      sed '/^$/d; s/^machine/\n- machine/; s/^compiler/- compiler/; s/^commit/- commit/'
    echo
    "$build/tests/test_optimum" methods | grep '^|'
  } >"$out/methods.tmp"
  mv "$out/methods.tmp" "$out/methods.md"
}

# forward steps where a rounding is worth a force, against quadruple precision
stiff() {
  ninja -C "$build" tests/test_stiff >/dev/null
  {
    provenance "# Steps where a rounding is worth a force

\`sh tests/results.sh stiff\`" | sed 's/^machine/- machine/; s/^compiler/- compiler/; s/^commit/- commit/'
    "$build/tests/test_stiff" table
  } >"$out/stiff.tmp"
  mv "$out/stiff.tmp" "$out/stiff.md"
}

# the tool is ended at random moments: of a motion that is certified at once, of one that three strategies are tried for
interruption() {
  ninja -C "$build" problems/cavort >/dev/null
  {
    provenance "sh tests/results.sh interruption"
    sh tests/interruption.sh "$build/problems/cavort" problems/motions/kick/problem.xml 50 20 1 --threads 1
    echo
    sh tests/interruption.sh "$build/problems/cavort" tests/rise.xml 50 20 2
  } >"$out/interruption.tmp"
  mv "$out/interruption.tmp" "$out/interruption.txt"
}

# many problems, and among them a killed process, a broken file, a full disk
batch() {
  ninja -C "$build" problems/cavort >/dev/null
  {
    provenance "sh tests/results.sh batch"
    sh tests/batch.sh "$build/problems/cavort" . 200
  } >"$out/batch.tmp"
  mv "$out/batch.tmp" "$out/batch.txt"
}

# a recorded walk to forces, beside force plates
walk() {
  ninja -C "$build" problems/cavort tests/walk_compare >/dev/null
  { provenance "sh tests/results.sh walk" && sh tests/walk.sh "$build"; } >"$out/walk.tmp"
  mv "$out/walk.tmp" "$out/walk.txt"
}

for name in ${*:-inverse heap update normal unused sweep mesh conservation orders sensors tendons actuation fluid optimum methods absent stiff}; do
  case $name in
    inverse) run inverse bench_inverse ;;
    heap) run heap bench_heap ;;
    newton) newton ;;
    update) run update bench_update ;;
    normal) normal ;;
    unused) run unused bench_unused ;;
    sweep) run sweep bench_sweep ;;
    mesh) mesh ;;
    conservation) run conservation test_conservation ;;
    orders) run orders bench_orders ;;
    sensors) run sensors test_sensor ;;
    tendons) run tendons test_tendon ;;
    actuation) run actuation test_actuation ;;
    fluid) run fluid test_fluid ;;
    optimum) optimum ;;
    methods) methods ;;
    stiff) stiff ;;
    absent) absent ;;
    iteration) iteration ;;
    warm) run warm bench_warm ;;
    interruption) interruption ;;
    batch) batch ;;
    walk) walk ;;
    *) echo "usage: sh tests/results.sh [inverse|heap|newton|update|normal|unused|sweep|mesh|conservation|orders|sensors|tendons|actuation|fluid|optimum|methods|absent|stiff|iteration|warm|interruption|batch|walk]..." >&2 && exit 2 ;;
  esac
done
