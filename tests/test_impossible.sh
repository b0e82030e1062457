#!/bin/sh
# Problems that cannot be solved, as a user would ask for them: each ends with exit status 1, its cause in the first line and
# within five seconds of processor time. Twins that can be solved are in test_feasibility.c. Usage: test_impossible.sh CAVORT SOURCE_ROOT
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
models=$(cd "$2" && pwd)/problems/models
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
n=0
failed=0

# asks MODEL HORIZON WORDS: a problem with the elements on standard input; the first line has these words
asks() {
  n=$((n + 1))
  { echo "<problem name='p' model='$1'>"; echo "<horizon $2/>"; cat; echo "</problem>"; } >p.xml
  rm -rf result*
  (ulimit -t 5 && "$cavort" solve p.xml -o result -q --threads 1 --strategies 1) >out 2>err
  status=$?
  head -n 1 err | grep -q '^cavort: impossible: ' && head -n 1 err | grep -qF -- "$3" &&
    [ $status -eq 1 ] && [ ! -d result ] && return
  failed=$((failed + 1))
  echo "failed: expected '$3', status $status:"
  head -n 3 err
}

# a start beside a box, its toes in that: how to stand on it is told, and inspect says no, too; over the box it stands on it
asks "$models/humanoid.xml" "duration='2' timestep='.025'" "the start: geom 'foot1_right' is 52 mm inside 'box'" <<'E2'
<scene><geom name="box" type="box" pos="0.3 0 0.15" size="0.25 0.4 0.15"/></scene><start key="stand" height="floor"/>
<goal key="stand" height="floor"><root pos="0.9 0 1.34"/></goal><cost><posture dofs="all" at="end" weight="900"/></cost>
E2
sed -n 2p err | grep -qF "height='floor' with its centre over it, or <root pos='X Y Z'/> with Z above it" || { failed=$((failed + 1)); echo "failed: how to stand on it"; sed -n 2p err; }
"$cavort" inspect p.xml >out 2>&1 && { failed=$((failed + 1)); echo "failed: inspect of what is impossible says yes"; }
for z in 0.9 1 1.7; do
  sed "s|<start key=.stand. height=.floor./>|<start key='stand' height='floor'><root pos='0.3 0 $z'/></start>|" p.xml >above.xml
  "$cavort" inspect above.xml >out 2>&1 || { failed=$((failed + 1)); echo "failed: a start above a box"; head -n 2 out; }
done

# no actuator has the energy: 16 m up
asks "$models/humanoid.xml" "duration='3' timestep='.025'" "too high to jump: it takes" <<'E2'
<start key="stand" height="floor"/><goal key="stand" height="floor"/>
<cost><sensor name="apex" type="subtreecom" body="torso" component="z" relative="goal" target="16" at="1.5" weight="900"/></cost>
E2
# in the air for a second
asks "$models/humanoid.xml" "duration='2.4' timestep='.03'" "nothing can hold it up there" <<'E2'
<start key="stand" height="floor"/><cost><posture dofs="all" at="end" weight="900"/>
<sensor name="up" type="subtreecom" body="torso" component="z" target="1.4" from="0.9" to="1.9" weight="900"/></cost>
E2
# the same of a planar leg that is asked of its trunk
asks "$models/hopper.xml" "duration='2' timestep='.025'" "too high to jump: it takes" <<'E2'
<start height="floor"><joint name="knee" degrees="60"/></start>
<cost><sensor name="over the house" type="framepos" body="torso" component="z" target="10" at="0.9" weight="900"/></cost>
E2
# both legs bent faster than a step allows
asks "$models/humanoid.xml" "duration='1' timestep='.025'" "in one step of 0.025 s its range of 2.63 allows 106 rad/s" <<'E2'
<start key="stand" height="floor"/><constraint><velocity name="kick" joint="knee_right" target="2000" at="0.5"/></constraint>
E2
# an elbow that may only creep
asks "$models/humanoid.xml" "duration='1' timestep='.025'" "too far for its speed: limits of speed leave" <<'E2'
<start key="stand" height="floor"/><constraint><velocity joint="elbow_right" lower="-0.5" upper="0.5"/></constraint>
<cost><posture joint="elbow_right" qpos="1.2" at="0.5" weight="900"/></cost>
E2
# a stroll that is to cover five metres in three seconds
asks "$models/humanoid.xml" "duration='3' timestep='.025'" "too far for its speed: 4.97 m away" <<'E2'
<start key="stand" height="floor"/><goal key="stand" height="floor"><root pos="5 0 1"/></goal>
<constraint><sensor name="stroll" type="subtreelinvel" body="torso" component="x" lower="-0.5" upper="0.5"/></constraint>
<cost><sensor name="there" type="subtreecom" body="torso" component="x" relative="start" target="5" at="end" weight="900"/></cost>
E2
# ice under sliding feet
sed 's/friction="[0-9. ]*"/friction="0 0 0"/g' "$models/humanoid.xml" >ice.xml
asks ice.xml "duration='3' timestep='.025'" "nothing can push it there: there is no friction" <<'E2'
<start key="stand" height="floor"/><goal key="stand" height="floor"><root pos="1.8 0 1"/></goal>
<cost><posture dofs="all" at="end" weight="900"/></cost>
E2
# the hand behind the wall of its own reach
asks "$models/arm.xml" "duration='1' timestep='.02'" "out of reach by" <<'E2'
<start key="stand"/><cost><sensor name="target" type="framepos" body="hand" target="1.4 0 0.3" at="end" weight="900"/></cost>
E2
# and inside of a crate
asks "$models/arm.xml" "duration='1' timestep='.02'" "inside 'crate'" <<'E2'
<scene><geom name="crate" type="box" pos="0.6 0 0.2" size="0.12 0.12 0.2"/></scene>
<start key="stand"/><cost><sensor name="target" type="framepos" geom="tool" target="0.6 0 0.2" at="end" weight="900"/></cost>
E2
# one hand in two places
asks "$models/arm.xml" "duration='1' timestep='.02'" "'left' wants" <<'E2'
<start key="stand"/><cost><sensor name="right" type="framepos" body="hand" target="0.5 -0.2 0.3" at="end" weight="900"/>
<sensor name="left" type="framepos" body="hand" target="0.5 0.2 0.3" at="end" weight="900"/></cost>
E2
# a hand and a foot farther apart than the body is tall
asks "$models/humanoid.xml" "duration='1' timestep='.025'" "cannot be so far apart" <<'E2'
<start key="stand" height="floor"/><cost>
<sensor name="hand" type="framepos" body="hand_right" target="0 -0.3 2.6" at="0.5" weight="900"/>
<sensor name="foot" type="framepos" body="foot_right" target="0 -0.1 0.06" at="0.5" weight="900"/></cost>
E2
# a joint past its stop
asks "$models/humanoid.xml" "duration='1' timestep='.025'" "its range is" <<'E2'
<start key="stand" height="floor"/><cost><posture joint="elbow_right" qpos="-3.4" at="end" weight="900"/></cost>
E2
# a crate too heavy for the hoist, held within the usual tolerance
cat >hoist.xml <<'E2'
<mujoco><worldbody><body name="hook"><joint name="hoist" type="slide" axis="0 0 1" limited="true" range="0 2"/><geom type="sphere"
size=".1" mass="5"/><body name="crate" pos="0 0 -.5"><geom type="box" size=".2 .2 .2" mass="60"/></body></body></worldbody><actuator>
<motor name="winch" joint="hoist" gear="500" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
asks hoist.xml "duration='4' timestep='.05'" "joint 'hoist' needs at least" <<'E2'
<start><joint name="hoist" pos="1"/></start><cost><posture name="hang" joint="hoist" qpos="1" from="1" to="3" weight="900"/></cost>
E2
# an arm held out straight with a third of its motors
cat >reach.xml <<'E2'
<mujoco><worldbody><body name="upper" pos="0 0 2"><joint name="shoulder" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .5 0 0"
size=".04" mass="2"/><body name="lower" pos=".5 0 0"><joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .5 0 0"
size=".03" mass="1.5"/></body></body></worldbody><actuator><motor joint="shoulder" gear="40" ctrllimited="true" ctrlrange="-1 1"/>
<motor joint="elbow" gear="20" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
asks reach.xml "duration='6' timestep='.05'" "actuators at 0.33 of their limits give it 13.2" <<'E2'
<start><joint name="shoulder" degrees="60"/></start><goal/><limits effort="0.33"/>
<cost><posture name="held out" dofs="all" qpos="0 0" from="2" to="end" weight="900"/></cost>
E2
# a swing-up in less than its least time
cat >rod.xml <<'E2'
<mujoco><worldbody><body name="rod"><joint name="pivot" axis="0 1 0"/><inertial pos="0 0 -1" mass="1" diaginertia="1e-6 1e-6 1e-6"/>
</body></worldbody><actuator><motor joint="pivot" gear="1" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
asks rod.xml "duration='4' timestep='.05'" "in the time: it takes at least" <<'E2'
<start/><goal><joint name="pivot" pos="3.1416"/></goal><cost><posture dofs="all" at="end" weight="900"/></cost>
E2
# out of the plane that it lives in
asks "$models/hopper.xml" "duration='1' timestep='.025'" "no joint moves it along y" <<'E2'
<start height="floor"><joint name="knee" degrees="60"/></start><cost><sensor name="aside" type="framepos" body="torso" component="y" target="0.5" at="end" weight="900"/></cost>
E2
# a trolley that is asked to be as fast as its motor never gets it
cat >trolley.xml <<'E2'
<mujoco><worldbody><body name="trolley"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".2 .1 .1" mass="20"/></body>
</worldbody><actuator><motor joint="rail" gear="30" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
asks trolley.xml "duration='2' timestep='.02' close='open'" "too fast for the time: 5.99 m/s are asked for" <<'E2'
<start/><cost><sensor name="dash" type="jointvel" joint="rail" target="6" at="end" weight="900" within="0.01"/></cost>
E2
# and far ahead
asks trolley.xml "duration='2' timestep='.02' close='open'" "9.97 m from the start, but at full effort it comes 3.06 m far in 2 s" <<'E2'
<start/><cost><posture name="far" joint="rail" qpos="10" at="end" weight="900"/></cost>
E2
# from rest to rest at its height: mu g T^2/2 at most, what a hop of that time takes, 2.51 m in 0.8 s (here a step longer, 2.67 m), as
# gravity has to take back what it rises
asks "$models/humanoid.xml" "duration='0.8' timestep='.025'" "it takes a centre of mass at most 2.7" <<'E2'
<start key="stand" height="floor"/><goal key="stand" height="floor"><root pos="3 0 1.34"/></goal>
<cost><sensor name="there" type="subtreecom" body="torso" relative="goal" target="0 0 0" at="end" weight="900"/></cost>
E2
# eight metres in half a second, and forty in three, of a body that only its feet push
asks "$models/humanoid.xml" "duration='0.5' timestep='.025'" "friction (0.8) cannot push it there in time" <<'E2'
<start key="stand" height="floor"/><cost><sensor name="there" type="subtreecom" body="torso" component="x" relative="start" target="8" at="end" weight="900"/></cost>
E2
asks "$models/humanoid.xml" "duration='3' timestep='.025'" "friction (0.8) cannot push it there in time" <<'E2'
<start key="stand" height="floor"/><goal key="stand" height="floor"><root pos="40 0 1"/></goal><cost><posture dofs="all" at="end" weight="900"/></cost>
E2

# a force of what is only seen
cat >pad.xml <<'E2'
<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="finger" pos="0 0 .2"><joint name="slide" type="slide" axis="0 0 1"/><geom size=".05"/>
<body name="pad" pos="0 0 -.05"><geom size=".01" contype="0" conaffinity="0"/></body></body></worldbody><actuator><motor joint="slide"/></actuator></mujoco>
E2
asks pad.xml "duration='1' timestep='.02'" "'press' wants a touch of body 'pad' at 1 s, but nothing can touch it" <<'E2'
<start/><cost><sensor name="press" type="touch" body="pad" target="8" within="3" at="end" weight="9"/></cost>
E2
grep -q "Ask it of body 'finger', on which it hangs" err || { failed=$((failed + 1)); echo "failed: the body that can touch is not told"; }

# of several bounds of one thing the tightest, once
once() {
  "$cavort" inspect "$1" >out 2>&1
  [ "$(grep -c impossible out)" = 1 ] && head -n 1 out | grep -qF -- "$2" && return
  failed=$((failed + 1))
  echo "failed: once '$2':"
  grep impossible out
}
echo '<problem name="p" model="trolley.xml"><horizon duration="2" timestep=".02" close="open"/><start/><cost><posture name="far" joint="rail"
qpos="10" at="end" weight="900"/></cost></problem>' >far.xml
once far.xml "at full effort it comes 3.06 m far in 2 s"
echo '<problem name="p" model="rod.xml"><horizon duration="4" timestep=".05"/><start/><goal><joint name="pivot" pos="3.1416"/></goal><cost>
<posture dofs="all" at="end" weight="900"/></cost></problem>' >up.xml
once up.xml "it takes at least 10.7 s"
echo "<problem name='p' model='$models/hopper.xml'><horizon duration='1' timestep='.025'/><start height='floor'><joint name='knee' degrees='60'/></start>
<cost><sensor name='aside' type='framepos' body='torso' component='y' target='0.5' at='end' weight='900'/></cost></problem>" >side.xml
once side.xml "no joint moves it along y"

echo "$n problems, $failed failed"
[ "$failed" = 0 ] && [ "$n" -ge 12 ]
