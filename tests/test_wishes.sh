#!/bin/sh
# What users asked for and how it has to be answered: files of a minute's work, each with what its answer must say.
# Usage: test_wishes.sh CAVORT SOURCE_ROOT
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
models=$(cd "$2" && pwd)/problems/models
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
n=0
failed=0

# says FILE WORDS: the file has these words
says() {
  n=$((n + 1))
  grep -qF -- "$2" "$1" && return
  failed=$((failed + 1))
  echo "failed: no '$2' in $1:"
  head -n 12 "$1"
}

# ends STATUS WANTED WHAT
ends() {
  n=$((n + 1))
  [ "$1" -eq "$2" ] && return
  failed=$((failed + 1))
  echo "failed: $3 ended with $1, expected $2"
}

# contacts that fade over two millimetres hold a leg in the air: a smaller smoothing is found by itself, and told
cat >hover.xml <<E2
<problem name="hover" model="$models/hopper.xml"><horizon duration="0.6" timestep=".02" order="momentum"/><schedule><last
smoothing="0.002"/></schedule><start height="floor"><joint name="knee" degrees="60"/></start><goal height="floor"><joint name="knee"
degrees="60"/></goal><cost/></problem>
E2
"$cavort" solve hover.xml -o hover --threads 1 >hover.out 2>hover.err
ends $? 0 "a leg that hovers"
says hover/strategies.csv "stated,0,not certified"
says hover/strategies.csv "<last smoothing='0.0005'/>"
says hover.out "strategy repaired: not as the problem states it, but with <last smoothing="
"$cavort" explain hover >explain.out
says explain.out "this motion is not of the problem as it was stated, but with <last smoothing="

# a cart that friction slows and nothing stops: what may end moving is said how
cat >rail.xml <<'E2'
<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0" damping="5"/><geom type="box" size=".2 .1 .1" mass="2"/>
</body></worldbody></mujoco>
E2
echo '<problem name="coast" model="rail.xml"><horizon duration="1" timestep=".02"/><start qvel="1"/><cost/></problem>' >coast.xml
"$cavort" solve coast.xml -o coast --threads 1 >coast.out 2>coast.err
ends $? 1 "a cart that cannot be at rest"
says coast.err 'certified and achieved where the end may still move: <horizon close="open"/>'
"$cavort" explain coast >explain.out
says explain.out '<horizon close="open"/> where it may still move'
sed 's/timestep=".02"/timestep=".02" close="open"/' coast.xml >open.xml
"$cavort" solve open.xml -o open --threads 1 -q >open.out 2>&1
ends $? 0 "a cart that may go on"

# rows and nothing else: any motion that keeps them will do, and one is found; in the least time, with no cost on the way
cat >block.xml <<'E2'
<mujoco><option gravity="0 0 0"/><worldbody><body name="cart"><joint name="x" type="slide" axis="1 0 0"/><geom type="box" size=".1 .1 .1"
mass="2" contype="0" conaffinity="0"/></body></worldbody><actuator><motor joint="x" ctrlrange="-4 4" ctrllimited="true"/></actuator></mujoco>
E2
rows='<start/><limits effort="1"/><cost><effort weight="0"/><velocity weight="0"/><acceleration weight="0"/><posture weight="0"/></cost>
<constraint><sensor type="jointpos" joint="x" target="1" at="end"/><velocity joint="x" at="end"/></constraint></problem>'
echo "<problem name='rows' model='block.xml'><horizon duration='2' timestep='0.02' close='open'/>$rows" >rows.xml
echo "<problem name='least' model='block.xml'><horizon duration='2' timestep='0.02' close='open' range='0.5 4' weight='1'/>$rows" >least.xml
for name in rows least; do
  "$cavort" solve $name.xml -o $name --threads 1 --strategies 1 -q >$name.out 2>&1
  ends $? 0 "a block that $name alone hold"
done
says least/verdict.json '"duration": 1.41421356'

# milliseconds for seconds: said at once, and nothing of that size is evaluated
sed 's/timestep=".02"/timestep=".000002"/' coast.xml >ms.xml
(ulimit -t 5 && "$cavort" inspect ms.xml) >ms.out 2>&1
ends $? 0 "a problem of half a million knots"
says ms.out "500001 knots"

# a load that the arm cannot hold, asked for with tolerances: no proof, but said
sed 's/ mass="0.3"/ mass="500"/' "$models/arm.xml" >heavy.xml
cat >load.xml <<'E2'
<problem name="load" model="heavy.xml"><horizon duration="2" timestep="0.025"/><start key="stand"/><cost><posture dofs="all" from="1" to="2"
weight="900"/></cost></problem>
E2
"$cavort" inspect load.xml >load.out 2>&1
says load.out "note: at rest, posture 'start' cannot be held"

# a tall box on its way over: certified as asked, and told
cat >tall.xml <<'E2'
<mujoco><worldbody><geom type="plane" size="5 5 1"/><body name="box" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .1 .5" mass="5"/>
</body></worldbody></mujoco>
E2
echo '<problem name="tip" model="tall.xml"><horizon duration="0.3" timestep=".02" close="open" order="momentum"/><start height="floor"
qvel="0.5 0 0 0 1 0"/><cost/></problem>' >tip.xml
"$cavort" solve tip.xml -o tip --threads 1 >tip.out 2>tip.err
says tip.out "note: it ends in motion: 'box' at "

# what no actuator moves follows from its start: no weight is advised
sed 's|<cost/>|<cost><sensor name="gone" type="subtreecom" body="box" component="x" target="0.3" at="end" weight="9"/></cost>|' tip.xml >gone.xml
"$cavort" solve gone.xml -o gone --threads 1 >gone.out 2>gone.err
ends $? 1 "a box that is to be elsewhere"
"$cavort" explain gone >explain.out
says explain.out "no actuator moves this model: the motion follows from its start"

# a block that slides to a stop within v^2/(2 mu g) = 0.408 m: simulated, no iteration is needed; steps of 10 ms are within 10 mm
cat >block.xml <<'E2'
<mujoco><worldbody><geom type="plane" size="5 5 1" friction=".5"/><body name="block" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05"
mass="2" friction=".5"/></body></worldbody></mujoco>
E2
echo '<problem name="slide" model="block.xml"><horizon duration="0.8" timestep=".01"/><start height="floor" qvel="2 0 0 0 0 0"/><cost>
<slip body="block" weight="0" within="any"/><sensor name="stop" type="framepos" body="block" component="x" target="0.4077" at="end" weight="1"
within="0.0105"/></cost></problem>' >slide.xml
"$cavort" solve slide.xml -o slide --threads 1 >slide.out 2>slide.err
ends $? 0 "a block that slides to a stop"
says slide/verdict.json '"iterations": 0'
"$cavort" quality nothere 2>err
ends $? 2 "quality of no folder"
says err "nothere: no such folder or file"

# farther than the search comes, and not so far that it is proven: what was used of actuators and ranges, and no verdict on the wish
cat >far.xml <<E2
<problem name="far" model="$models/humanoid.xml"><horizon duration="0.5" timestep=".025" order="momentum"/><start key="stand" height="floor"/><cost><clearance weight="0"/>
<sensor name="there" type="subtreecom" body="torso" component="x" relative="start" target="4" at="end" weight="900"/></cost></problem>
E2
"$cavort" solve far.xml -o far --threads 1 --strategies 1 >far.out 2>far.err
ends $? 1 "four metres in half a second"
"$cavort" explain far >explain.out
says explain.out "8 m a second"
says explain.out "no limit is at its end: actuators give at most"
says explain.out "nothing proves that it cannot be had, nor that it can"
says explain.out ", or a higher weight does"
# what the solve tried in vain is not advised
echo "near-1,0,not achieved,9,9,1,0,0.5,\"weight of 'there' 10 times\",\"misses 'there' by 3 m (within 0.03) at 0.5 s: wanted 4, got 1\"" >>far/strategies.csv
"$cavort" explain far >explain.out
says explain.out "; 10 times the stated weight was tried (strategies.csv) and did not do: misses 'there' by 3 m (within 0.03) at 0.5 s."
grep -q "a higher weight does" explain.out && failed=$((failed + 1)) && echo "failed: more weight is advised, which was tried in vain"

# a metre in half a second takes 16 N where 12.5 are had: with twice as many it is found, and told
cat >weak.xml <<'E2'
<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom type="sphere" size="0.1" mass="1"/></body></worldbody>
<actuator><motor joint="x" name="m" ctrllimited="true" ctrlrange="-12.5 12.5"/></actuator></mujoco>
E2
cat >dash.xml <<'E2'
<problem name="dash" model="weak.xml"><horizon duration="0.5" range="0.4 0.5"/><start/><goal><joint name="x" pos="1"/></goal>
<cost><posture dofs="all" at="end" weight="900"/><velocity dofs="all" at="end" weight="100"/></cost></problem>
E2
"$cavort" solve dash.xml --force --threads 1 -o dash >dash.out 2>dash.err
ends $? 1 "a metre in half a second by a weak motor"
says dash.err "but a motion is found where they are 2 times as strong: the model is too weak for this"
says dash/strategies.csv "2 times the strength would do"
"$cavort" explain dash >explain.out
says explain.out "but a motion is found where they are 2 times as strong"

# a record of a joint given as a guess: how its column has to be called there
printf 'time,rail\n0,0\n1,0.5\n' >record.csv
echo '<problem name="g" model="rail.xml"><horizon duration="1" close="open"/><start/><guess file="record.csv"/><cost/></problem>' >guess.xml
"$cavort" solve guess.xml -o guess -q 2>err
says err "column 'rail': the model has no such value; did you mean 'qpos_rail'?"

# a motor's force at one time has a tolerance, too: a twentieth of its limit
cat >pushed.xml <<'E2'
<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".2 .1 .1" mass="2"/></body>
</worldbody><actuator><motor name="push" joint="rail" gear="30" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
echo '<problem name="f" model="pushed.xml"><horizon duration="1"/><start/><cost><sensor name="force" type="actuatorfrc" actuator="push" target="0.9"
at="0.5" weight="1e-6"/></cost></problem>' >force.xml
"$cavort" solve force.xml -o force --threads 1 --strategies 1 >force.out 2>err
ends $? 1 "a force that is not there"
says force.out "0.05 N or N m MISSED"

# dry friction of 20 N at 4 cm/s, as the guide has it: 9.2 N by the usual smoothing_self, all of it at a tenth
sed 's/name="rail"/name="rail" frictionloss="20"/' pushed.xml >dry.xml
for smoothing in 0.001 0.0001; do
  echo "<problem name='dry' model='dry.xml'><horizon duration='1' timestep='.025'/><schedule><last smoothing_self='$smoothing'/></schedule><start/>
<goal><joint name='rail' pos='.02'/></goal><constraint><velocity joint='rail' target='.04' from='.3' to='.7'/></constraint><cost/></problem>" >dry.problem
  "$cavort" solve dry.problem -o dry --threads 1 -q >dry.out 2>err
  ends $? 0 "a cart on dry friction"
  awk -F, '$1 == 0.5 { printf "%.1f N\n", 30 * $2 }' dry/controls.csv >>dry.force
done
says dry.force "9.2 N"
says dry.force "20.0 N"

# what no motor moves comes to rest by its dry friction: a wagon on a track that a cart shunts, at rest at the end
cat >shunt.xml <<'E2'
<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".2 .1 .1" mass="2"/></body>
<body name="wagon" pos=".5 0 0"><joint name="track" type="slide" axis="1 0 0" frictionloss="4"/><geom type="box" size=".2 .1 .1" mass="3"/></body>
</worldbody><actuator><motor name="push" joint="rail" gear="60" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
echo '<problem name="shunt" model="shunt.xml"><horizon duration="1.5"/><start/><goal><joint name="track" pos="0.4"/></goal>
<cost><sensor name="there" type="jointpos" joint="track" target="0.4" at="end" weight="900"/></cost></problem>' >shunt.problem
"$cavort" solve shunt.problem -o shunt --threads 1 --strategies 1 >shunt.out 2>err
ends $? 0 "a wagon that dry friction stops"
# as far as its stop; and left alone it is not thrown out by the stop that it begins at
sed 's/frictionloss="4"/& limited="true" range="0 0.4"/' shunt.xml >stop.xml
sed 's/shunt.xml/stop.xml/' shunt.problem >stop.problem
"$cavort" solve stop.problem -o stop --threads 1 --strategies 1 >stop.out 2>err
ends $? 0 "a wagon shunted up to its stop"
echo '<problem name="idle" model="stop.xml"><horizon duration="1"/><start/><goal><joint name="rail" pos="-.2"/></goal>
<cost><posture dofs="all" at="end" weight="900"/></cost></problem>' >idle.problem
"$cavort" solve idle.problem -o idle --threads 1 --strategies 1 >idle.out 2>err
ends $? 0 "a wagon that stands at its stop"
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "qpos_track") c = i } NR > 1 && ($c > 1e-6 || $c < -1e-6) { print "moved", $1, $c }
  END { print NR - 1, "knots" }' idle/trajectory.csv >idle.moved
says idle.moved "41 knots"
ends "$(grep -c moved idle.moved)" 0 "knots at which it has moved by a micrometre"

# a body that nothing reaches: what leads there, in place of more weight
cat >far.xml.model <<'E2'
<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".2 .1 .1" mass="2"/></body>
<body name="lid" pos="9 0 0"><joint name="hinge" axis="0 0 1"/><geom type="box" size=".2 .1 .1" pos=".2 0 0" mass="2"/></body>
</worldbody><actuator><motor name="push" joint="rail" gear="30" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>
E2
mv far.xml.model lid.xml
echo '<problem name="lid" model="lid.xml"><horizon duration="1"/><start/><cost><sensor name="open" type="jointpos" joint="hinge" target="0.5" at="end"
weight="900"/></cost></problem>' >lid.problem
"$cavort" solve lid.problem -o lid --threads 1 --strategies 1 >lid.out 2>err
ends $? 1 "a lid that nothing touches"
"$cavort" explain lid >explain.out
says explain.out "nothing that an actuator moves touches 'lid'"
says explain.out "refname=\"lid\""
# the same, asked for by a posture of all joints
echo '<problem name="lid" model="lid.xml"><horizon duration="1"/><start/><goal><joint name="hinge" pos="0.5"/></goal>
<cost><posture name="final" dofs="all" at="end" weight="900"/></cost></problem>' >whole.problem
"$cavort" solve whole.problem -o whole --threads 1 --strategies 1 >lid.out 2>err
ends $? 1 "a lid that nothing touches, in a posture"
"$cavort" explain whole >explain.out
says explain.out "'final' is 0.5 rad from where the start has it, and nothing that an actuator moves touches 'lid'"

echo "$n answers, $failed failed"
[ "$failed" = 0 ] && [ "$n" -ge 23 ]
