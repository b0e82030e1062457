#!/bin/sh
# cavort mhe: of a mass on a spring whose noisy places come in one by one, some missing, the command tells the states and standard
# errors of the Kalman filter, which awk has of its own; a humanoid that is pushed is followed; what is asked wrongly is told.
# Usage: test_mhe.sh CAVORT SOURCE
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

cat >"$work/spring.xml" <<'X'
<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="x" type="slide" axis="1 0 0" stiffness="18"/>
<geom type="sphere" size=".1" mass="2"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>
X
# places of a swing with noise that is none: any numbers do
awk 'BEGIN { print "time,x"; for (k = 0; k <= 80; k++) {
  printf "%.2f,", k / 50; if (k % 5 == 3) print ""; else printf "%.17g\n", .3 * cos(3 * k / 50) + .01 * sin(k * k) } }' >"$work/place.csv"
# a force of 1.5 N for each step: its weight 1/(1.5^2 h)
cat >"$work/problem.xml" <<'X'
<problem name="spring" model="spring.xml"><horizon duration="1.6" timestep="0.02" order="euler" close="open"/><start free="true"/>
<cost><track file="place.csv" joints="x" sd="0.01" gap="0"/><posture at="0" weight="1" scale="0.5"/><velocity at="0" dofs="all" weight="1" scale="2"/>
<effort weight="22.222222222222222"/><posture weight="0"/><velocity weight="0"/><acceleration weight="0"/></cost></problem>
X
# v' = v + h (u - k x)/m as the step has it: springs are of the position that it begins at; x' = x + h v'
awk -F, 'NR > 1 { z[NR - 2] = $2 } END {
  h = .02; k = 18; m = 2; q = 1.5 * 1.5; r = 1e-4
  x = 0; v = 0; a = .25; b = 0; c = 4
  for (t = 0; t <= 80; t++) {
    if (t) {
      f = -h * k / m; g = h / m
      # A = (1 + h f, h; f, 1)
      A = 1 + h * f; y = A * x + h * v; v = f * x + v; x = y
      aa = A * A * a + 2 * A * h * b + h * h * c + q * g * g * h * h
      bb = A * f * a + (A + h * f) * b + h * c + q * g * g * h
      c = f * f * a + 2 * f * b + c + q * g * g
      a = aa; b = bb
    }
    if (z[t] != "") {
      s = a + r; ka = a / s; kb = b / s; o = z[t] - x
      x += ka * o; v += kb * o; c -= kb * b; b -= ka * b; a -= ka * a
    }
    printf "%.12g %.12g %.12g %.12g\n", x, v, sqrt(a), sqrt(c)
  } }' "$work/place.csv" >"$work/filter"
"$cavort" mhe "$work/problem.xml" --knots 4 -o "$work/a" >"$work/out" 2>&1
check 'spring: status' $? 0
for file in trajectory.csv stderr.csv updates.csv touch.csv view.html; do check "$file" "$(test -s "$work/a/$file" && echo 1)" 1; done
cut -d, -f2,3 "$work/a/trajectory.csv" >"$work/state"
cut -d, -f2,3 "$work/a/stderr.csv" | paste -d, "$work/state" - | tail -n +2 | paste -d' ' - "$work/filter" | tr ',' ' ' | awk '
  { if (NF != 8) bad++; for (i = 1; i <= 4; i++) { d = $i - $(i + 4); if (d < 0) d = -d; if (d > 1e-7) bad++; if (d > most) most = d } n++ }
  END { print n, bad + 0; printf "largest difference from the filter %.1e\n", most >"/dev/stderr" }' >"$work/compared"
check 'residuals: not lost' "$(grep -c '^chi-square of a window' "$work/out") $(grep -c LOST "$work/out")" '1 0'
check 'the Kalman filter' "$(cat "$work/compared")" '81 0'
"$cavort" mhe "$work/problem.xml" --knots 4 -q -o "$work/b" >"$work/quiet" 2>&1
check 'quiet' "$(wc -c <"$work/quiet" | tr -d ' ')" 0
cmp -s "$work/a/trajectory.csv" "$work/b/trajectory.csv" && cmp -s "$work/a/stderr.csv" "$work/b/stderr.csv"
check 'the same twice' $? 0

# what is known of the start is no target of the whole record's estimate
"$cavort" solve "$work/problem.xml" -q --threads 1 --strategies 1 -o "$work/whole" >"$work/out" 2>&1
check 'the whole record: status' $? 0
# limits that hold nothing back change nothing: the spring takes 5 N, of which a motor of 2 N is never asked
sed 's|<motor joint="x"/>|<motor joint="x" ctrllimited="true" ctrlrange="-2 2"/>|' "$work/spring.xml" >"$work/limited.xml"
sed 's|spring.xml|limited.xml|; s|<effort weight="[0-9.]*"/>|<effort weight="88.888888888888889"/>|; s|</cost>|</cost><limits effort="1"/>|' "$work/problem.xml" >"$work/limited_problem.xml"
"$cavort" mhe "$work/limited_problem.xml" --knots 4 -q -o "$work/d" >"$work/out" 2>&1
check 'limits: status' $? 0
paste -d, "$work/a/trajectory.csv" "$work/d/trajectory.csv" | awk -F, 'NR > 1 { for (i = 2; i <= 4; i++) { d = $i - $(i + 4); if (d < 0) d = -d; if (d > 1e-7) bad++ } if ($4 + 0 > 2 || $4 + 0 < -2) bad++; n++ }
  END { print n, bad + 0 }' >"$work/compared"
check 'no force at the open end' "$(tail -n 1 "$work/a/trajectory.csv" | awk -F, '{ print NF, $4 }')" '4 '
check 'limits that hold nothing' "$(cat "$work/compared")" '81 0'

# readings that are fifty times as far off as they are said to be: states and standard errors alike, but the residuals tell
awk -F, 'NR == 1 { print; next } { if ($2 != "") $2 += (NR % 2 ? .5 : -.5); print $1 "," $2 }' "$work/place.csv" >"$work/off.csv"
sed 's/place.csv/off.csv/' "$work/problem.xml" >"$work/off.xml"
"$cavort" mhe "$work/off.xml" --knots 4 -o "$work/e" >"$work/out" 2>&1
check 'readings that are off: told' "$(grep -c '^LOST' "$work/out")" 1
check 'readings that are off: in the table' "$(awk -F, 'NR > 20 && $4 > 100 * $5 { n++ } END { print (n > 40) }' "$work/e/updates.csv")" 1

# 0.6 s of the humanoid's record, before and in a push of 200 N
"$cavort" mhe "$source/problems/mhe/stand.xml" --knots 5 --threads 2 -o "$work/c" >"$work/out" 2>&1
check 'stand: status' $? 0
check 'stand: place is not told' "$(grep -c 'place .*more than at the start' "$work/out")" 1
# mean of the force along y on the torso: none before, most of the push in it
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "qfrc_root_1" || $i == "u_root_1") at = i }
  NR > 20 && NR < 45 { before += $at / 24 } NR > 54 && NR < 62 { push += $at / 7 }
  END { print (at > 0), (before > -15 && before < 15), (push > 120 && push < 240) }' "$work/c/trajectory.csv" >"$work/push"
check 'stand: the push' "$(cat "$work/push")" '1 1 1'

refused() {
  text=$1
  shift
  "$cavort" mhe -o "$work/none" "$@" >"$work/out" 2>&1
  check "status of $*" $? 2
  check "text of $*" "$(grep -c -- "$text" "$work/out")" 1
}
refused 'a window of 3 to 81 knots, as many as the problem has, got 2' "$work/problem.xml" --knots 2
refused 'a window of 3 to 81 knots, as many as the problem has, got 82' "$work/problem.xml" --knots 82
refused 'start free="true"' "$source/problems/mpc/stand.xml"
sed 's/<track[^>]*>//' "$work/problem.xml" >"$work/none.xml"
refused 'expected a record' "$work/none.xml"
sed 's/<effort weight="[^"]*"/<effort to="0.5" weight="1"/' "$work/problem.xml" >"$work/part.xml"
refused 'over the whole window' "$work/part.xml"
echo "$checks checks, $failed failed"
[ "$failed" = 0 ]
