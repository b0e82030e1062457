#!/bin/sh
# cavort mpc: a humanoid that is pushed stays on its feet, a push that is too strong fells it, all but the times told is the same
# twice, and what is asked wrongly is told. Usage: test_mpc.sh CAVORT SOURCE
set -u
cavort=$1
source=$2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
failed=0
checks=0

check() {
  checks=$((checks + 1))
  [ "$2" = "$3" ] && return
  failed=$((failed + 1))
  echo "failed: $1: expected '$3', got '$2'"
}

refused() {
  text=$1
  shift
  "$cavort" mpc "$source/problems/mpc/stand.xml" -o "$work/none" "$@" >"$work/out" 2>&1
  check "status of $*" $? 2
  check "text of $*" "$(grep -c -- "$text" "$work/out")" 1
}

stand="$cavort mpc $source/problems/mpc/stand.xml --knots 20"
$stand --push "20 torso y 0.5" --push "20 torso -x 0.5" -o "$work/a" >"$work/out" 2>&1
check 'two pushes: status' $? 0
check 'two pushes: stands' "$(grep -c ' stands, ' "$work/out")" 2
check 'two pushes: count' "$(grep -c 'stands at the end of 2 of 2 runs' "$work/out")" 1
for file in runs.csv plans.csv trajectory.csv view.html; do check "$file" "$(test -s "$work/a/$file" && echo 1)" 1; done
$stand --push "20 torso y 0.5" --push "20 torso -x 0.5" -q -o "$work/b" >"$work/quiet" 2>&1
check 'quiet' "$(wc -c <"$work/quiet" | tr -d ' ')" 0
cmp -s "$work/a/runs.csv" "$work/b/runs.csv"
check 'runs are the same twice' $? 0
cmp -s "$work/a/trajectory.csv" "$work/b/trajectory.csv"
check 'the motion is the same twice' $? 0

$stand --push "150 torso y 0.2" --duration 1.5 -o "$work/c" >"$work/out" 2>&1
check 'too strong: status' $? 1
check 'too strong: told' "$(grep -c 'does not stand' "$work/out")" 1
$stand --push "20 torso 90 0.1 0.05" --rate 50 --iterations 1 --deadline 0.01 --stiffness 20 --duration 0.3 \
  -o "$work/d" >"$work/out" 2>&1
check 'options' "$(grep -c '27 dofs, 20 knots of 25 ms, 50 plans a second, 1 iteration each, in force after 10 ms, springs of 20' "$work/out")" 1

refused "DIRECTION is no axis" --push "20 torso sideways 0.5"
refused "there is something missing" --push "20 torso y"
refused "when the last push ends" --push "20 torso x 5" --duration 1
refused "when the last push ends" --push "20 torso x 0.95" --duration 1
refused "there is something left over" --push "20 torso y 0.5 0.1 7"
refused "no body of that name" --push "20 nothing y 0.5"
refused "expected at most the time between plans" --deadline 1
refused "whole milliseconds apart" --rate 300
refused "knots of a plan from 2" --knots 1
refused "knots of a plan from 2" --knots 41

# a planar model is not pushed out of its plane, and stands no such push
"$cavort" mpc "$source/problems/motions/walker-jump/problem.xml" -o "$work/none" --push "20 torso y 0.5" >"$work/out" 2>&1
check 'planar, sideways: status' $? 2
check 'planar, sideways: text' "$(grep -c 'no joint of the model lets BODY move in that DIRECTION' "$work/out")" 1
echo "$checks checks, $failed failed"
[ "$failed" = 0 ]
