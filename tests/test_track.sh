#!/bin/sh
# cavort track on clips whose forces are known: a box that rests on the floor, its weight under its middle, and one that flies,
# which nothing pushes; a third of the frames of one marker hidden. Usage: test_track.sh CAVORT
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failed=0

fail() {
  failed=$((failed + 1))
  echo "failed: $1"
}

cat >box.xml <<'X'
<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1"/><body name="box" pos="0 0 .1"><freejoint name="root"/>
<geom type="box" size=".2 .1 .1" mass="2"/></body></worldbody></mujoco>
X
cat >set.xml <<'X'
<markers><marker name="a" body="box" pos=".2 .1 .1"/><marker name="b" body="box" pos="-.2 .1 .1"/>
<marker name="c" body="box" pos=".2 -.1 -.1"/><marker name="d" body="box" pos="-.2 -.1 .1"/></markers>
X

# clip NAME X Y Z VX VZ G: markers of the box at X Y Z, with that velocity and acceleration; b is hidden every third frame
clip() {
  awk -v x="$2" -v y="$3" -v z="$4" -v vx="$5" -v vz="$6" -v g="$7" 'BEGIN {
    split(".2 .1 .1 -.2 .1 .1 .2 -.1 -.1 -.2 -.1 .1", p, " ")
    printf "time"; for (i = 0; i < 4; i++) { n = substr("abcd", i + 1, 1); printf ",%s_x,%s_y,%s_z", n, n, n }
    for (f = 0; f <= 60; f++) {
      t = f / 100; printf "\n%.17g", 3 + t
      for (i = 0; i < 4; i++)
        if (i == 1 && f % 3 == 1) printf ",,,"
        else printf ",%.17g,%.17g,%.17g", x + vx * t + p[3*i+1], y + p[3*i+2], z + vz * t - g * t * t / 2 + p[3*i+3]
    }
    printf "\n" }' >"$1.csv"
}

clip rest .5 -.3 .1 0 0 0
clip flight 0 0 1 .7 2 9.81
# harder than what carries a body on the pads of its feet: a light box would hover
"$cavort" track rest.csv --model box.xml --markers set.xml --set schedule/last/@smoothing=0.0004 --threads 1 >out 2>err || fail "a box at rest: $(tail -n 3 err out)"
# soft contacts carry it two millimetres above the floor
grep -q '^markers [01].[0-9]* mm rms' out || fail "markers of a box at rest: $(grep '^markers' out)"
# weight 19.62 N, under the middle, once what the start has is settled
awk -F, 'NR == 1 { if ($0 != "time,box_fx,box_fy,box_fz,box_mz,box_x,box_y") bad = 1 }
  NR > 9 && $4 != "" { n++; if ($4 < 19.5 || $4 > 19.75 || $6 < .49 || $6 > .51 || $7 < -.31 || $7 > -.29) bad++ }
  END { exit !(n > 15 && !bad) }' rest.track/cop.csv || fail "centre of pressure: $(head -n 5 rest.track/cop.csv)"
awk -F, 'NR > 1 { n++; if ($7 > 2e-3 || $6 < 10 || $4 != "position" || $5 != "m") bad++ } END { exit !(n == 4 && !bad) }' rest.track/result/records.csv || fail "records.csv"
"$cavort" track flight.csv --model box.xml --markers set.xml --from 3.1 --until 3.5 --threads 1 -o thrown >out 2>err ||
  fail "a box in flight: $(tail -n 3 err out)"
[ "$(head -n 1 thrown/cop.csv)" = time ] || fail "a box in flight is pushed: $(head -n 2 thrown/cop.csv)"
grep -q '^markers 0.0[0-9]* mm rms' out || fail "markers in flight: $(grep '^markers' out)"
# what was written is a problem that can be solved again
"$cavort" solve thrown/problem.xml -o again --strategies 1 --threads 1 -q || fail "the problem again"
cmp -s again/trajectory.csv thrown/result/trajectory.csv || fail "the problem again gives another motion"
"$cavort" track flight.csv --model box.xml --markers set.xml --from 3.59 2>err && fail "no time"
grep -q 'expected three steps' err || fail "no time: $(cat err)"
[ ! -e flight.track ] || fail "no time leaves a folder"
"$cavort" track flight.csv --model box.xml --markers set.xml --from 3.4 --until 3.2 >out 2>err && fail "an end before the start"
[ ! -s out ] || fail "an end before the start is fitted first: $(cat out)"
sed 's/<markers>/<markers retarget="true">/' set.xml >other.xml
"$cavort" track flight.csv --model box.xml --markers other.xml 2>err && fail "a clip of another body"
grep -q 'repair.xml' err || fail "a clip of another body: $(cat err)"
sed 's|ik/markers.xml|../other.xml|' thrown/problem.xml >thrown/other.xml
"$cavort" inspect thrown/other.xml >out 2>err && fail "a record of another body"
grep -q 'thrown/other.xml:.*markers.*repair.xml' err || fail "a record of another body: $(cat err)"
"$cavort" track flight.csv --model box.xml --markers set.xml --from 3.1 --until 3.5 --threads 1 -o unweighed >out 2>err
grep -q 'forces are those of 2.0 kg, the model' out || fail "mass: $(tail -n 3 out)"
"$cavort" track flight.csv --model box.xml --markers set.xml --from x 2>err && fail "a time that is none"
grep -q 'expected a number from 0' err || fail "a time that is none: $(cat err)"
# A ball that flies up out of the floor, its record 30 mm in it at first: no contact has to act, so dynamics allows it, and nothing else
# than the price of depth beyond 4 mm holds the free start out. There the pull of a record of 0.6 m is 2 N at most, 0.02 mm of it.
cat >ball.xml <<'X'
<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 .1"><joint name="z" type="slide" axis="0 0 1"/>
<geom type="sphere" size=".1" mass="2"/></body></worldbody></mujoco>
X
awk 'BEGIN { print "time,qpos_z"; for (f = 0; f <= 30; f++) { t = f / 100; printf "%.17g,%.17g\n", t, -.03 + 2 * t - 4.905 * t * t } }' >ball.csv
cat >ball-problem.xml <<'X'
<problem name="ball" model="ball.xml"><horizon duration="0.3" timestep="0.01" close="open"/><start free="true"/><guess file="ball.csv"/>
<cost><track file="ball.csv" joints="all" sd="0.6 2"/></cost></problem>
X
"$cavort" solve ball-problem.xml -q --threads 1 --strategies 1 -o ball >ball.log 2>&1 || fail "a ball that flies out of the floor: $(cat ball.log)"
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "qpos_z") c = i } NR == 2 { exit !($c > -.0041 && $c < -.003) }' ball/trajectory.csv ||
  fail "a free start in the floor: $(sed -n 2p ball/trajectory.csv)"
"$cavort" solve ball-problem.xml -q --set schedule/@optimality=2 -o refused >ball.log 2>&1 && fail "an optimality of 2"
grep -q optimality ball.log || fail "a refusal that does not name optimality: $(cat ball.log)"

echo "$failed failed"
[ $failed -eq 0 ]
