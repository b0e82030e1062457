#!/bin/sh
# What inspect says of a problem before it is solved: which terms count, what start and goal have of what is asked, what excludes each
# other, where start and goal touch and are too deep, which way joints move.
# Usage: test_inspect.sh CAVORT SOURCE_ROOT
. "$(dirname "$0")/command.sh"

# inspected STATUS ARGUMENT...: what it prints is in out and err
inspected() {
  wanted=$1
  shift
  run "$wanted" inspect --all "$@"
}
not_said() { check "does not say: $1" sh -c '! grep -qF -- "$1" out' sh "$1"; }

# --- terms: names, tolerances, what achieved needs ---

cat >model.xml <<'TEXT'
<mujoco model="two"><option timestep="0.02"/><worldbody><geom name="ground" type="plane" size="9 9 1"/>
<body name="rod" pos="0 0 2"><joint name="pivot" axis="0 1 0" damping=".1"/>
<geom name="bob" pos="0 0 -.5" size=".05" mass="1"/></body>
<body name="box" pos="2 0 .1"><freejoint name="box"/><geom name="box" type="box" size=".1 .1 .1"/></body></worldbody>
<actuator><motor joint="pivot" gear="10" ctrlrange="-1 1"/></actuator></mujoco>
TEXT
cat >terms.xml <<'TEXT'
<problem name="terms" model="model.xml"><horizon duration="1" timestep=".02"/><start/>
<cost><posture name="final" dofs="all" at="end" weight="900"/>
<sensor name="near" type="framepos" body="box" reftype="xbody" refname="rod" component="z" target="-1.9" weight="3"/>
<sensor name="soft" type="touch" body="rod" within="5" weight="1"/>
<sensor name="free" type="touch" body="rod" weight="1"/>
<sensor name="hint" type="framepos" body="rod" target="0 0 1.5" at=".5" within="any" weight="1"/>
<slip body="box" weight="0" within="0.2"/></cost>
<constraint><sensor name="level" type="framequat" body="box" at="end"/></constraint></problem>
TEXT
inspected 0 terms.xml
says out "costs; achieved needs those that are to be met, the rest is not asked for"
says out "  weight 900        'final': posture of all dofs to the goal at 1 s; to be met within 0.1 rad, 0.03 m (usual)"
says out "  weight 3          'near': framepos of box, z, in the frame of rod to -1.9; reported only, no within="
says out "  weight 1          'soft': touch of rod to 0; to be met within 5 N"
check "over the whole horizon without within: a running cost" grep -qx "  weight 1          'free': touch of rod to 0" out
says out "'hint': framepos of rod to 0 0 1.5 at 0.5 s; reported only, within=\"any\""
says out "slip of loaded contacts of body box; these may slide by 0.2 m/s"
says out "  must be           'level': framequat of box to no rotation at 1 s; to be met within 1e-06 rad"
check "a name that is the element's is not repeated" grep -q "^  weight 1000       gap of" out

# --- brief: what is asked beside what start and goal have; what excludes each other; what is open, and never measured ---

brief() {
  "$cavort" inspect "$@" >out 2>err
  status=$?
}
# row NAME START GOAL WANTED: of the table of readings
row() { check "row: $*, not '$(grep -F "  $1" out | tail -n 1)'" grep -qxE "  $1 +$2 +$3 +$4" out; }
brief terms.xml
check "brief: status $status" [ "$status" -eq 0 ]
check "brief is short: $(wc -l <out) lines" [ "$(wc -l <out)" -lt 40 ]
check "running costs in a line" grep -q "^  running costs by weight: effort 1, joint velocity 0.05, " out
not_said "takes the place of"
says out "  goal   no <goal>: the goal posture is the start"
says out "  weight 900        'final': posture of all dofs to the goal at 1 s; to be met within 0.1 rad, 0.03 m (usual)"
row "'near' z, m" -1.9 -1.9 -1.9
row "'soft', N" - - 0
says out "  -: not known of a posture: forces, and velocities but those of <start>"
row "'level', rad" "0 off" "0 off" "0 off"
row "'hint', m" "0 0 1.5" "0 0 1.5" "0 0 1.5"
not_said "an evaluation of the inverse"
says out "--all: joints, places of bodies, where surfaces end"
check "the verdict is the last line" [ "$(tail -n 1 out)" = "nothing proves it impossible: cavort solve terms.xml" ]
brief model.xml
check "of a model what it holds" grep -q "^pivot  *hinge" out
not_said "an evaluation of the inverse"
# asked TEXT: the problem with these terms; HORIZON and GOAL by variables
asked() {
  echo "<problem name='asked' model='model.xml'><horizon duration='1' timestep='.02' $horizon/><start/>$goal<cost>$1</cost></problem>" >asked.xml
  brief asked.xml
}
horizon= goal=
asked '<sensor name="fast" type="framelinvel" body="rod" target="1 0 0" at=".5" weight="1"/>
<sensor name="slow" type="framelinvel" body="rod" target="0 0 0" from=".4" to=".6" weight="1"/>'
check "two speeds at one time: status $status" [ "$status" -eq 1 ]
check "they exclude each other" sh -c 'head -n 1 out | grep -qF "impossible: '"'fast' wants a framelinvel of body 'rod' at 0.5 s to be 1 0 0, but 'slow' wants 0 0 0 then"'"'
asked '<sensor name="fast" type="framelinvel" body="rod" target="1 0 0" at=".5" weight="1"/>
<sensor name="slow" type="framelinvel" body="rod" target="0 0 0" at=".6" weight="1"/>'
check "at two times they do not" [ "$status" -eq 0 ]
asked '<sensor name="turned" type="framequat" body="box" target="0.7071 0 0 0.7071" at=".5" weight="1"/>
<sensor name="level" type="framequat" body="box" from=".4" to=".6" within=".1" weight="1"/>'
check "two orientations: status $status" [ "$status" -eq 1 ]
row "'turned', rad" "1.571 off" "1.571 off" "0 off"
asked '<sensor name="turned" type="framequat" body="box" target="0.7071 0 0 0.7071" at=".5" weight="1" within="any"/>
<sensor name="level" type="framequat" body="box" from=".4" to=".6" within=".1" weight="1"/>'
check "one that is reported only excludes nothing" [ "$status" -eq 0 ]
asked '<sensor name="apart" type="framepos" body="box" reftype="xbody" refname="rod" component="x" target="2" at=".5" weight="1"/>
<sensor name="near" type="framepos" body="box" reftype="xbody" refname="rod" component="x" target="1" at=".5" weight="1"/>'
check "two places in a frame that moves: status $status" [ "$status" -eq 1 ]
# a goal that no term asks for, and a target at the end; one that is asked for
goal='<goal><joint name="pivot" pos=".5"/></goal>'
asked '<sensor name="swung" type="framezaxis" xbody="rod" target="1 0 0" at="end" weight="9"/>'
says out "note: the goal disagrees with 'swung', which wants z 0 (within 0.1) at the end: the goal's posture has 0.878. It only leads the guess"
not_said "no <goal>"
asked '<sensor name="swung" type="framezaxis" xbody="rod" target="1 0 0" at="end" weight="9"/><posture dofs="all" at="end" weight="9"/>'
says out "note: the goal disagrees with 'swung', which wants z 0 (within 0.1) at the end: the goal's posture, which 'posture' asks for, has 0.878 there"
row "posture, farthest pivot, rad" 0 0.5 0.5
asked '<sensor name="swung" type="framezaxis" xbody="rod" target="1 0 0" at=".5" weight="9"/>'
not_said "disagrees"
goal=
not_said "not known of a posture"
# targets without digits that are rounding
asked '<sensor name="aside" type="framepos" body="box" component="y" target="-1e-18" at="end" weight="9"/>'
says out "'aside': framepos of box, y to 0 at 1 s"
# postures of one joint and targets along waypoints by their values, in words and in the table
asked '<posture name="bent" joint="pivot" degrees="90" at="end" weight="9"/>
<velocity joint="pivot" target="2" at=".5" weight="9"/>
<posture name="swings" joint="pivot" weight="9" within=".1"><waypoint time="0" qpos="0"/><waypoint time="1" degrees="30"/></posture>
<posture name="moved" weight="9" within=".1" dofs="all"><waypoint time="0" qpos="0 2 0 .1 1 0 0 0"/>
<waypoint time="1" qpos="0 3 0 .1 1 0 0 0"/></posture>
<sensor name="across" type="framepos" body="box" component="y" from=".5" weight="9" within=".1"><waypoint time="0" target="-.15"/>
<waypoint time="1" target=".15"/></sensor>
<sensor name="by" type="framepos" body="box" weight="9" within=".1"><waypoint time="0" target="2 0 1"/>
<waypoint time="1" target="2 1 1"/></sensor>'
says out "'bent': posture of joint pivot to 1.571 rad (90 degrees) at 1 s;"
says out "velocity of joint pivot to 2 at 0.5 s;"
says out "'swings': posture of joint pivot to 0 rad (0 degrees) .. 0.5236 rad (30 degrees) along 2 waypoints;"
says out "'moved': posture of all dofs along 2 waypoints;"
says out "'across': framepos of box, y to -0.15 .. 0.15 along 2 waypoints from 0.5 to 1 s;"
says out "'by': framepos of box to 2 0 1 .. 2 1 1 along 2 waypoints;"
row "'bent', rad" 0 0 1.571
row "'swings', rad" 0 0 "from 0 to 0.5236"
row "'moved', farthest box x, m" 2 2 "from 2 to 3"
row "'across' y, m" 0 0 "from 0 to 0.15"
row "'by', m" "2 0 0.1" "2 0 0.1" "from 2 0 1 to 2 1 1"
# whom running costs are for, and the defaults of all joints in whose place costs of one are
asked '<velocity joint="pivot" weight="1"/><force body="box" weight="100"/><posture dofs="root_linear" weight="10"/><impact name="soft" body="box" weight="3"/>'
check "whom a running cost is for" sh -c 'tr -s " \n" " " <out | grep -qF "velocity of pivot 1, force of box 100, posture of root_linear 10, soft 3 note"'
says out "  note: <posture dofs=\"root_linear\"> takes the place of the default 'posture' 0.1 of all joints: state that again where it is wanted"
not_said "joint velocity"
# two joints, one of them left out; weight 0 of one has no other any more, either
cat >arm.xml <<'TEXT'
<mujoco><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0"/><geom name="upper" size=".05"/><body name="fore" pos=".5 0 0">
<joint name="elbow" axis="0 1 0"/><geom name="fore" size=".05"/></body></body></worldbody><actuator><motor joint="shoulder"/></actuator></mujoco>
TEXT
for cost in '<velocity joint="elbow" weight="1"/>' '<velocity joint="elbow" weight="0"/>'; do
  echo "<problem name='arm' model='arm.xml'><horizon duration='1'/><start/><cost>$cost</cost></problem>" >narrow.xml
  brief narrow.xml
  says out "  note: <velocity joint=\"elbow\"> takes the place of the default 'joint velocity' 0.05 of all joints: state that again where it is wanted"
done
for beside in '<velocity weight="0.05"/>' '<velocity joint="shoulder" weight="0.05"/>'; do
  sed "s#</cost>#$beside&#" narrow.xml >stated.xml
  brief stated.xml
  not_said "takes the place of"
done
sed 's/ weight="0"/ at="end"&/' narrow.xml >window.xml
brief window.xml
not_said "takes the place of"
# a base that a posture of joints leaves open
brief "$root/problems/motions/squat-jump/problem.xml" --set "cost/final posture/@dofs=joints"
says out "; leaves height, place and tilt of the base open"
brief "$root/problems/motions/squat-jump/problem.xml"
not_said "of the base open"
# forces at an open end
horizon='close="open"'
asked '<sensor name="load" type="touch" body="rod" target="20" within="5" at="end" weight="1"/>'
says out "never measured: a motion with close=\"open\" has no forces at its last knot; ask at 0.98 s, or before"
says out "no term has to be met"
horizon=
asked '<sensor name="load" type="touch" body="rod" target="20" within="5" at="end" weight="1"/>'
says out "touch of rod to 20 at 1 s; to be met within 5 N"

# geoms and actuators without a name: what they are, and where, to be found in the file
sed 's|<start/>|<scene><geom type="box" size=".3 .3 .05" pos="2 0 .15"/></scene>&|' asked.xml >nameless.xml
brief nameless.xml
check "a geom of the world" grep -qE "^impossible: the start: geom 'box' is [0-9.]+ mm inside 'geom [0-9] of world \(box 0.3 0.3 0.05 at 2 0 0.15\)'" out
sed 's/ ctrlrange="-1 1"//' model.xml >unlimited.xml
brief unlimited.xml
says out "the first is number 0, 'actuator 1 (of joint 'pivot')'): a plan may take any force"

# --- joints: what a positive change moves where ---

line() { sed -n "s/^$1  *[a-z]* .*  + \(.*\)/\1/p" out; }
joint() { check "$1: + $2, not + $(line "$1")" [ "$(line "$1")" = "$2" ]; }
inspected 0 "$root/problems/models/humanoid.xml"
says out "knee_right           hinge  -149..1.72 deg     -190..190 N m     0 deg      + foot_right forwards"
says out "hand_right           hand_right           capsule      0.03 0.0225"
says out "keyframes: stand, squat, prone, supine"
# a thing in the air at the start falls, and its weight is not the humanoid's
echo "<problem name='air' model='$root/problems/models/humanoid.xml'><scene><body name='ball' pos='.6 0 1'><freejoint name='ball'/>
<geom name='ball' size='.1' mass='1'/></body></scene><horizon duration='2'/><start key='stand'/><cost/></problem>" >air.xml
inspected 0 air.xml
says out "note: at the start 'ball' touches nothing and is at rest, 0.9 m above what is below it: it falls"
says out "mass 66 kg, 65 of it what actuators move"
# principal axes that are turned from the body's own, and directions in the file's axes
turned() {
  { sed 's#<cost/></problem>##' air.xml && echo "<cost>$1</cost></problem>"; } >turned-axes.xml
  inspected 0 turned-axes.xml
}
turned '<sensor name="upright" type="framezaxis" body="torso" target="0 0 1" at="end" weight="9"/>'
says out "note: 'upright' reads axis z of the principal axes of inertia of body 'torso', turned by 90 degrees from the body's own: xbody=\"torso\" has that of the file"
turned '<sensor name="upright" type="framequat" body="torso" target="1 0 0 0" at="end" weight="9"/>'
says out "note: 'upright' reads the orientation of the principal axes of inertia of body 'torso', turned by 90 degrees"
turned '<sensor name="upright" type="framezaxis" xbody="torso" target="0 0 1" at="end" weight="9"/>
<sensor name="as there" type="framequat" body="torso" relative="goal" at="end" weight="9"/>
<sensor name="level" type="framezaxis" body="ball" target="0 0 1" at="end" weight="9"/>'
not_said "principal axes"
# terms of free roots count things, too; what need not be met, and what names all dofs, does so as it says
turned '<posture name="final uprightness" dofs="root_angular" at="end" weight="9"/>'
says out "note: 'final uprightness' counts 'ball', too, which no actuator moves: <sensor type=\"framequat\" xbody=\"torso\" relative=\"goal\" .../> is of 'torso' alone"
turned '<velocity dofs="root_linear" at="end" weight="9"/>'
says out "note: velocity counts 'ball', too, which no actuator moves: <sensor type=\"framelinvel\" xbody=\"torso\" .../> is of 'torso' alone"
turned '<posture dofs="root_angular" weight="9"/><velocity dofs="root_linear" at="end" weight="9" within="any"/>
<velocity dofs="all" at="end" weight="9"/><posture joint="root" at="end" weight="9"/>'
not_said "counts 'ball'"
# no geom to stand on
echo '<mujoco><worldbody><body><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body></worldbody></mujoco>' >ghost.xml
inspected 0 ghost.xml
says out "no geom can touch another, so nothing stands on the ground or on anything else"
# one actuator for two joints, by a tendon
cat >pair.xml <<'TEXT'
<mujoco><worldbody><body><joint name="left" axis="0 1 0"/><geom size=".1"/></body><body pos="1 0 0"><joint name="right" axis="0 1 0"/>
<geom size=".1"/></body></worldbody><tendon><fixed name="both"><joint joint="left" coef="1"/><joint joint="right" coef="-2"/></fixed></tendon>
<actuator><motor tendon="both" gear="3" ctrllimited="true" ctrlrange="-1 2"/></actuator></mujoco>
TEXT
inspected 0 pair.xml
says out "-3..6 N m *"
says out "-12..6 N m *"
says out "* by an actuator that moves other joints, too"
inspected 0 "$root/problems/models/humanoid.xml"
joint knee_right "foot_right forwards"
joint abdomen_z "turns pelvis to the left"
joint ankle_y_left "foot_left down"
joint elbow_left "hand_left forwards"
inspected 0 "$root/problems/models/robot.xml"
joint knee_right "foot_right backwards"
joint ankle_roll_left "rolls foot_left to the right"
joint waist_yaw "turns chest to the left"
inspected 0 "$root/problems/models/walker.xml"
joint z "torso up"
joint pitch "tips torso forwards"

# against where bodies are when the joint has been moved
places() { sed -n '/^places/,/^$/p' "$1"; }
moved() {
  cat >moved.xml <<TEXT
<problem name="moved" model="$1"><horizon duration="1"/><start/><goal ranges="clip"><joint name="$2" degrees="$3"/></goal></problem>
TEXT
  "$cavort" inspect --all moved.xml >moved.out 2>&1
  # start and goal of that body: which way it went most
  places moved.out | awk -v body="$4" '$1 == body { for (k = 0; k < 3; k++) d[k] = $(5 + k) - $(2 + k); most = 0
    for (k = 1; k < 3; k++) if (d[k] * d[k] > d[most] * d[most]) most = k
    split(d[most] > 0 ? "forwards left up" : "backwards right down", way, " "); print way[most + 1] }'
}
for model in humanoid robot; do
  path=$root/problems/models/$model.xml
  "$cavort" inspect "$path" >rows 2>&1
  sed -n 's/^\([a-z_0-9]*\)  *hinge  *\([-0-9.]*\)[.][.]\([-0-9.]*\) deg .*+ \([a-z_]*\) \([a-z]*\).*/\1 \2 \3 \4 \5/p' rows |
    grep -vE 'ankle|wrist|turns|rolls|tips' >rows.txt
  check "$model: joints are looked at" [ "$(wc -l <rows.txt)" -ge 12 ]
  while read -r name low high body way; do
    # to the side where there is room
    to=$(echo "$low $high" | awk '{ print ($2 > 8) ? 8 : -8 }')
    found=$(moved "$path" "$name" "$to" "$body")
    case $to:$found in
      -*:forwards) found=backwards ;; -*:backwards) found=forwards ;; -*:left) found=right ;;
      -*:right) found=left ;; -*:up) found=down ;; -*:down) found=up ;;
    esac
    check "$model: $name moves $body $found, not $way" [ "$way" = "$found" ]
  done <rows.txt
done

# a root that lies: seen from itself; and one that the file has turned, by its feet
cat >lying.xml <<TEXT
<problem name="lying" model="$root/problems/models/humanoid.xml"><horizon duration="1"/>
<start><root pos="0 0 1" euler="0 90 0"/></start></problem>
TEXT
inspected 0 lying.xml
joint knee_right "foot_right forwards"
sed 's/<body name="torso"[^>]*/& euler="0 0 1.5708"/' "$root/problems/models/humanoid.xml" >turned.xml
inspected 0 turned.xml
joint knee_right "foot_right forwards"
check "the comment of new has it" sh -c '"$1" new "$2" -o written.xml -q && grep -q "knee_right .* degrees; + foot_right forwards" written.xml' \
  sh "$cavort" "$root/problems/models/humanoid.xml"

# --- where surfaces end: of roles, of things where the start has them, of geoms of the world ---

# surface NAME LOW HIGH LOW HIGH LOW HIGH [WHAT]: of the table
surface() {
  check "surface: $*, not '$(sed -n '/^surfaces/,/^$/p' out | grep "^  $1 ")'" \
    grep -qxE "  $1 +$2 \.\. +$3 +$4 \.\. +$5 +$6 \.\. +$7${8:+ +$8}" out
}
cat >surfaces.xml <<TEXT
<problem name="surfaces" model="$root/problems/models/humanoid.xml"><scene>
<geom name="bar" type="capsule" fromto="1 -.5 .3 1 .5 .3" size=".05"/><geom name="seen" type="box" pos="4 0 0" size=".1 .1 .1" contype="0" conaffinity="0"/>
<body name="wall" pos="0 -2 1"><geom type="box" size="1 .1 1"/></body><body name="box" pos="2 0 .1"><freejoint name="box"/>
<geom type="box" size=".3 .2 .1"/><body name="lid" pos="0 0 .2"><geom type="box" size=".1 .1 .1"/></body></body></scene>
<horizon duration="1"/><start key="stand" height="floor"><root joint="box" pos="3 0 .1" euler="0 0 90"/></start><cost/></problem>
TEXT
inspected 0 surfaces.xml
surface "right foot" "[-0-9.]+" "[-0-9.]+" "-[0-9.]+" "-[0-9.]+" 0.000 "0.0[0-9]+" foot_right
surface "left foot" "[-0-9.]+" "[-0-9.]+" "0.[0-9]+" "0.[0-9]+" 0.000 "0.0[0-9]+" foot_left
surface bar 0.950 1.050 -0.550 0.550 0.250 0.350 "geom of the world"
surface wall -1.000 1.000 -2.100 -1.900 0.000 2.000 "fixed to the world"
surface box 2.800 3.200 -0.300 0.300 0.000 0.400
sed -n '/^surfaces/,/^$/p' out >surfaces.txt
check "no more than these" sh -c '! grep -qE "^  (seen|lid|floor|thigh_right) " surfaces.txt'
inspected 0 model.xml
check "of a model at the posture of its file" grep -q "^surfaces, m  *least .* at the posture of the file, of what can touch" out
surface box 1.900 2.100 -0.100 0.100 0.000 0.200

# --- postures: what touches, what is in what ---

humanoid=$root/problems/models/humanoid.xml
# posture HORIZON START: a problem of the humanoid with that start and a goal
posture() {
  { echo "<problem name='p' model='$humanoid'><horizon duration='1'/>"; cat; echo "</problem>"; } >p.xml
}
posture <<'TEXT'
<start key="stand" height="floor"/><goal><root pos="0 0 1.25"/></goal>
TEXT
inspected 0 p.xml
says out ", touches the world with foot_right, foot_left in x "
check "the goal's pair" grep -qE "^  goal .*, deepest penetration [0-9.]+ mm: 'foot[0-9]_(right|left)' in 'floor'$" out
says out "note: the goal has geom 'foot"
posture <<'TEXT'
<start><root pos="0 0 2"/></start>
TEXT
inspected 0 p.xml
check "in the air" grep -qE "^  start  .* m, touches nothing of the world$" out
posture <<'TEXT'
<start key="supine" height="floor"/>
TEXT
inspected 0 p.xml
check "with --all each is named" grep -qE "touches the world with (\w+, ){8,}\w+ in x" out
run 0 inspect p.xml
check "many are counted" grep -qE "touches the world with (\w+, ){7}\w+ and [0-9]+ more in x" out
# a hand in the other hand, where a start is found: a note, and no word of a solid to be moved
posture <<'TEXT'
<start free="true" key="stand" height="floor"/><goal key="stand" height="floor"><joint name="shoulder1_right" degrees="25"/>
<joint name="shoulder1_left" degrees="25"/></goal>
TEXT
inspected 0 p.xml
check "link in link" grep -qE "^note: the goal has geom '.*' [0-9.]+ mm inside '.*', and a certificate allows 5: .*Change the posture$" out
posture <<'TEXT'
<start free="true"><root pos="0 0 1.2"/></start><goal key="stand" height="floor"/>
TEXT
inspected 0 p.xml
says out "note: the start has geom 'foot"
says out "the guess begins there, no motion does"
sed -i 's/<start free="true">/<cycle translation="1 0 0"\/><start>/' p.xml
inspected 0 p.xml
says out "the guess begins there, no motion does"

# --- a box that begins inside a table, and is not stopped by it; on it by what is told; a ball in the air ---

posture <<'TEXT'
<scene><body name="table" pos="1 0 .35"><geom name="tabletop" type="box" size=".4 .4 .05" pos="0 0 .3"/></body>
<body name="box" pos="2 0 .1"><freejoint name="box"/><geom name="box" type="box" size=".1 .1 .1"/></body>
<body name="ball" pos="3 0 .1"><freejoint name="ball"/><geom name="ball" size=".1"/></body></scene>
<start key="stand" height="floor"/>
<goal key="stand" height="floor"><root joint="box" pos="1 0 .72"/><root joint="ball" pos="3 0 1"/></goal>
TEXT
inspected 0 p.xml
says out "note: height=\"floor\" of <goal> raises 'box' by 0.08 m onto 'tabletop', inside which it begins, <goal> lowers 'ball' by 0.9 m; <root joint="
check "it lies on the table" grep -qE "^  box .* 1.000 +0.000 +0.800$" out
# its centre beside the table, it is not for it
sed -i 's/pos="1 0 .72"/pos="1.45 0 .72"/' p.xml
inspected 0 p.xml
says out "note: height=\"floor\" of <goal> lowers 'box' by 0.62 m, not stopped by 'tabletop', inside which it begins: 0.080 m higher it is on that"
says out "note: height=\"floor\" of <goal> lowers 'ball' by 0.9 m; <root joint="
sed -i 's/pos="1.45 0 .72"/pos="1 0 .80"/' p.xml
inspected 0 p.xml
not_said "tabletop', inside"
check "it lies on the table" grep -qE "^  box .* 1.000 +0.000 +0.800$" out

# --- over a platform a body stands on that, wherever its root is stated; a box over a back is put down there ---

posture <<'TEXT'
<scene><geom name="platform" type="box" pos="0 0 .1" size=".4 .4 .1"/></scene>
<start key="stand" height="floor"><root pos="0 0 1"/></start>
<goal key="stand" height="floor"><root pos="0 0 1.4"/></goal>
TEXT
inspected 0 p.xml
says out "start  centre of mass at 0.003 -0.000 1.164 m, touches the world with foot_right, foot_left"
says out "goal   centre of mass at 0.003 -0.000 1.164 m, touches the world with foot_right, foot_left"
says out "<start> raises 'torso' by 0.543 m onto 'platform', inside which it begins"
posture <<'TEXT'
<scene><body name="box" pos="0 0 1.6"><freejoint name="box"/><geom name="box" type="box" size=".1 .1 .05" mass="1"/></body></scene>
<start key="stand" height="floor"/><goal key="stand" height="floor"/>
TEXT
inspected 0 p.xml
check "a box over a head lies on it" grep -qE "^  start .*head touches box|^  start .*torso touches box" out

# --- what touches what else than the world; what is let go falls, and a motor that is too weak is told before that ---

cat >paddle.xml <<'TEXT'
<mujoco><worldbody><body name="paddle" pos="0 0 1"><joint name="paddle" type="slide" axis="0 0 1"/><geom name="paddle" type="box"
size=".2 .2 .02" mass=".5"/></body><body name="ball" pos="0 0 1.5"><joint name="ball" type="slide" axis="0 0 1"/><geom name="ball" size=".03"
mass=".1"/></body></worldbody><actuator><motor joint="paddle" ctrlrange="-40 40" ctrllimited="true"/></actuator></mujoco>
TEXT
cat >paddled.xml <<'TEXT'
<problem name="paddled" model="paddle.xml"><horizon duration="1"/><start/><goal><joint name="ball" pos="-0.45"/></goal><cost/></problem>
TEXT
inspected 0 paddled.xml
says out "note: at the start nothing holds 'ball', which no actuator moves: it begins to move along its joint 'ball', as is right of what is let go"
not_said "cannot be held"
check "in the air" grep -qE "^  start  .* m, touches nothing of the world$" out
check "on the paddle" grep -qE "^  goal   .* m, paddle touches ball$" out
sed -i 's/-40 40/-1 1/; s/mass=".1"/mass="1"/' paddle.xml
inspected 0 paddled.xml
check "the motor is told" grep -q "^note: at rest, posture 'start' cannot be held at 0.025 s: with actuator .* joint 'paddle' needs 4.905 N" out

# --- a model that solve refuses ---

cat >muscle.xml <<TEXT
<mujoco><worldbody><site name="a" pos="0 0 1"/><body><joint name="j" axis="0 1 0"/><geom size=".1"/><site name="b" pos="0 0 .3"/></body>
</worldbody><tendon><spatial name="t"><site site="a"/><site site="b"/></spatial></tendon><actuator><motor tendon="t"/></actuator></mujoco>
TEXT
echo '<problem name="m" model="muscle.xml"><horizon duration="1"/><start/><cost/></problem>' >muscles.xml
inspected 1 muscles.xml
says out "solve refuses its model, some of whose actuators cannot be planned with (above): muscles.xml"
not_said "nothing proves it impossible"

# --- what is beyond bodies: too far in too little time, too heavy to slide; told of what is asked, not of what could be ---

posture <<'TEXT'
<scene><body name="crate" pos="1 0 .4"><freejoint name="crate"/><geom name="crate" type="box" size=".3 .3 .4" mass="400"/></body></scene>
<start key="stand" height="floor"/>
TEXT
ask() {
  sed "s#</problem>#<cost>$1</cost></problem>#" p.xml >asked.xml
  inspected 0 asked.xml
}
ask '<sensor name="there" type="framepos" body="crate" component="x" target="1.5" at="end" weight="900"/>'
says out "note: to slide 'crate' (400 kg, friction 1) takes 3.92e+03 N; 'torso'"
ask '<sensor name="there" type="framepos" body="crate" component="x" target="1.01" at="end" weight="900"/>'
not_said "note: to slide"
ask '<sensor name="there" type="framepos" body="torso" component="x" target="1" at="0.2" weight="900"/>'
check "too soon" grep -qE "^note: 'there' has to bring 'torso' 0.9[0-9]+ m on in 0.2 s from rest, by [0-9.]+ g on the mean" out
ask '<sensor name="there" type="framepos" body="torso" component="x" target="1" at="0.5" weight="900"/>'
not_said "g on the mean"
ask '<sensor name="up" type="framepos" body="crate" target="1 0 1.4" at="end" weight="900"/>'
says out "note: to lift 'crate' (400 kg) takes 3.92e+03 N; 'torso' and all that hangs on it, which has to hold it, is 65"
not_said "note: to slide"
sed -i 's/mass="400"/mass="60"/' p.xml
ask '<sensor name="up" type="framepos" body="crate" target="1 0 1.4" at="end" weight="900"/>'
not_said "note: to lift"
ask '<sensor name="there" type="framepos" body="crate" component="x" target="1.5" at="end" weight="900"/>'
not_said "note: to slide"

# a thing slides with the larger friction of two geoms; its own counts where it has priority
for priority in 0 1; do
  posture <<TEXT
<scene><body name="chest" pos="0.42 0 0.35"><freejoint name="chest"/><geom name="chest" type="box" size="0.2 0.3 0.35" mass="25" friction="0.4" priority="$priority"/></body></scene>
<start key="stand" height="floor"/>
TEXT
  ask '<sensor name="there" type="framepos" body="chest" component="y" target="0.35" at="end" weight="900"/><slip body="chest" weight="0" within="any"/>'
  told="slides on 'floor' with a friction of 0.8: of two geoms that touch the larger counts, not its own 0.4"
  if [ "$priority" = 0 ]; then says out "note: 'chest' $told"; else not_said "$told"; fi
done

# a constraint on a joint at the end of its range is where its stop presses; a cost may be there
cat >crane.xml <<'TEXT'
<mujoco model="crane"><worldbody><body name="load"><joint name="hoist" type="slide" axis="0 0 1" range="0 2"/><geom size="0.1" mass="4"/></body></worldbody>
<actuator><motor joint="hoist" ctrlrange="0 90"/></actuator></mujoco>
TEXT
for use in constraint cost; do
  weight=$([ "$use" = constraint ] || echo ' weight="9"')
  cat >stop.xml <<TEXT
<problem name="stop" model="crane.xml"><horizon duration="2"/><start/><goal><joint name="hoist" pos="0"/></goal>
<$use><posture joint="hoist" at="end"$weight/></$use></problem>
TEXT
  inspected 0 stop.xml
  told="a <constraint> has joint 'hoist' at 0 m, 0 from the end of its range, where its stop presses"
  if [ "$use" = constraint ]; then says out "note: $told"; else not_said "$told"; fi
done

# --- a guess through a solid; the ground is what every guess is in a little ---
cat >block.xml <<TEXT
<problem name="block" model="$root/problems/models/humanoid.xml">
<scene><geom name="block" type="box" pos="0.5 0 0.1" size="0.1 0.5 0.1"/></scene>
<horizon duration="2"/><start key="stand" height="floor"/><goal key="stand" height="floor"><root pos="1 0 1.3"/></goal>
<cost><posture dofs="all" at="end" weight="900"/></cost></problem>
TEXT
inspected 0 block.xml
check "the guess runs into the block" grep -qE "^note: the guess runs into a solid, deepest [0-9.]+ mm at [0-9.]+ s: '.*' in 'block'" out
inspected 0 "$root/problems/motions/turn-over/problem.xml"
not_said "note: the guess runs"
# how solve begins there, and what it may try
inspected 0 block.xml
check "how it begins" grep -qE "^  the straight way from start to goal runs into a solid .*: begun over solids" out
check "strategies" grep -qE "^  stated +" out
check "repairs are counted, not listed" grep -qE "^  near-1\.\.[0-9]+ " out
check "surfaces at the goal" grep -q "^surfaces, m .* at the goal" out
# a bar of 12 mm on the ground, which feet pass by less than two centimetres deep
sed 's/type="box" pos="0.5 0 0.1" size="0.1 0.5 0.1"/type="capsule" fromto="0.5 -0.5 0.009 0.5 0.5 0.009" size="0.006"/' block.xml >bar.xml
inspected 0 bar.xml
check "the guess runs through a bar" grep -qE "^note: the guess runs into a solid, deepest 1[0-9.]+ mm .* in 'block'" out

# --- a goal at rest that nothing bears: sitting on nothing; on a seat it is borne ---
posture <<'TEXT'
<start key="stand" height="floor"/><goal key="sit" height="floor"/>
TEXT
inspected 0 p.xml
check "sitting on nothing" grep -qE "^  note: the goal as it stands would fall: its centre of mass is 0\.[0-9]+ m beside" out
posture <<'TEXT'
<scene><geom name="seat" type="box" pos="-0.15 0 0.215" size="0.2 0.2 0.215"/></scene>
<start key="stand" height="floor"><root pos="0.3 0"/></start><goal key="sit" height="floor"/>
TEXT
inspected 0 p.xml
not_said "would fall"

# links of one body, and a body in a thing, are no solids
posture <<'TEXT'
<start key="stand"><joint name="hip_x_right" degrees="15"/><joint name="hip_x_left" degrees="15"/><joint name="hip_y_right" degrees="-20"/>
<joint name="hip_y_left" degrees="20"/></start><goal key="stand"><joint name="hip_x_right" degrees="15"/><joint name="hip_x_left" degrees="15"/>
<joint name="hip_y_right" degrees="20"/><joint name="hip_y_left" degrees="-20"/></goal>
TEXT
inspected 0 p.xml
check "legs that cross" grep -qE "^note: links of the guess run into each other, deepest [0-9.]+ mm at [0-9.]+ s: '.*' in '.*' \(.*\): solve begins so, and its first stages let links of one body through each other" out
posture <<'TEXT'
<scene><body name="ball" pos="1 0 1"><freejoint name="ball"/><geom name="ball" size=".1" mass="1"/></body></scene>
<start key="stand" height="floor"><root joint="ball" pos="1 0 1" height="keep"/></start>
<goal key="stand" height="floor"><root joint="ball" pos="-1 0 1" height="keep"/></goal>
TEXT
inspected 0 p.xml
check "a ball through a trunk" grep -qE "^note: bodies of the guess run into each other, deepest [0-9.]+ mm at [0-9.]+ s: .* solve begins so, and contacts that are soft at first part them; or give <waypoint>s$" out

[ "$failed" -eq 0 ] && echo "$checks checks"
exit "$failed"
