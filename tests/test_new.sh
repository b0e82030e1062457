#!/bin/sh
# Problem files that cavort new writes: each can be read for every model that there is, names the model's own joints, and a few
# are solved. Usage: test_new.sh CAVORT SOURCE_ROOT; models of others from $CAVORT_SHARED_MODELS or ../shared/models, if there.
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$(cd "$2" && pwd)
shared=${CAVORT_SHARED_MODELS:-$root/../shared/models}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail() { failed=$((failed + 1)); echo "failed: $*"; }
cd "$root" || exit 1

# who stays where it is misses the wish: each number of the target, or the way, is beyond the tolerance (0.03 m where none stands)
stays() {
  sed -n 's/.*relative="start" target="\([^"]*\)"\(.*within="\([^"]*\)"\)\{0,1\}.*/\3 \1/p' "$1" |
    awk '{ square = 0; first = NF > 1 && /^[0-9]/ ? 2 : 1; for (i = first; i <= NF; i++) square += $i * $i
           within = first == 2 ? $1 : 0.03; if (sqrt(square) < 2 * within) exit 1 }'
}

# tried MODEL OPTION...: a problem for a model, read back
number=0
tried() {
  model=$1
  shift
  number=$((number + 1))
  written=$work/$number.xml
  "$cavort" new "$model" "$@" -o "$written" >"$work/out" 2>"$work/err" || { fail "new $model $*"; cat "$work/err"; return; }
  stays "$written" || fail "$model: what stays where it is does what is asked"
  "$cavort" inspect "$written" >"$work/read" 2>&1 && return
  # models whose actuators cannot be planned with are told
  grep -q "cannot be planned with" "$work/err" && grep -q "cannot be planned with" "$work/read" && return
  # and where the files of all its shapes are missing nothing can hold it up
  grep -q "^impossible: nothing can hold .* none of its bodies has a shape that may touch" "$work/read" && return
  fail "$model: what was written cannot be read"
  cat "$work/read"
}
for model in problems/models/*.xml; do
  tried "$model"
  [ ! -s "$work/err" ] || fail "$model: complains"
  grep -q "^impossible" "$work/read" && fail "$model: what was written is impossible"
done
tried problems/models/humanoid.xml
for name in abdomen_z "at 1.136 degrees" "Bodies: torso, head" "right hand (hand_right)" "Keyframes: stand, squat, prone, supine"; do
  grep -q -- "$name" "$written" || fail "the comment lists $name"
done
n=$(find "$shared" \( -name '*.xml' -o -name '*.urdf' \) 2>/dev/null | wc -l)
[ "$n" -gt 0 ] || echo "left out: models of others are not here"
find "$shared" \( -name '*.xml' -o -name '*.urdf' \) 2>/dev/null | sort >"$work/models"
while IFS= read -r model; do
  grep -qE '<mujoco|<robot' "$model" || continue
  case $model in
    */common/*)
      "$cavort" new "$model" -o "$work/none.xml" 2>"$work/err" && fail "$model: passes"
      grep -q "has no joint: nothing of it can move" "$work/err" || fail "$model: is not told" ;;
    *) tried "$model" ;;
  esac
done <"$work/models"
[ "$n" -eq 0 ] || tried "$shared/urdf/solo12.urdf" --floating
[ "$n" -eq 0 ] || grep -q 'floating="true"' "$written" || fail "a floating root is not said"
# who stands and whose file has no floor gets one
if [ "$n" -gt 0 ]; then
  "$cavort" new "$shared/menagerie/unitree_go1/go1.xml" -o "$work/go1.xml" -q || fail "new go1"
  grep -q 'name="floor" type="plane"' "$work/go1.xml" && grep -q 'key="stand" height="floor"' "$work/go1.xml" || fail "no floor"
  sed '/<scene>/,/<\/scene>/d' "$work/go1.xml" >"$work/bare.xml"
  "$cavort" inspect "$work/bare.xml" 2>"$work/err" >/dev/null && fail "height=floor without a floor passes"
  grep -q "has no floor: add one, <scene>" "$work/err" || fail "what to do without a floor is not told"
  sed -i 's/ height="floor"//' "$work/bare.xml"
  "$cavort" solve "$work/bare.xml" -o "$work/bare" -q 2>"$work/err" && fail "it stands on nothing"
  grep -q "impossible: nothing can hold 'trunk' up: there is no floor" "$work/err" || fail "a fall is not told"
fi

# a box that hangs on a string too long for its range, as it is modelled: it starts where the string is taut; where no posture
# has it so, the file is there all the same, and the error names the string without a name
cat >"$work/hangs.xml" <<'E2'
<mujoco model="hangs"><worldbody><site name="anchor" pos="0 0 .2"/><body pos="0 0 .1"><freejoint/><geom type="box" size=".01 .01 .01"/>
<site name="hook"/></body><body pos="1 0 0"><joint name="arm" axis="0 1 0"/><geom size=".05" pos=".3 0 0"/></body></worldbody>
<tendon><spatial limited="true" range="0 0.02"><site site="hook"/><site site="anchor"/></spatial></tendon>
<actuator><motor joint="arm" ctrlrange="-9 9" ctrllimited="true"/></actuator></mujoco>
E2
tried "$work/hangs.xml"
grep -q '<start ranges="clip"/>' "$written" || fail "a start within the range of a string"
# a rope that is too short, from where no dof changes its length
sed 's/range="0 0.02"/range="0.5 9"/; s/<freejoint\/>/<joint name="rail" type="slide" axis="1 0 0" range="-2 2" limited="true"\/>/' "$work/hangs.xml" >"$work/rope.xml"
tried "$work/rope.xml"
sed 's/<freejoint\/>/<joint name="spin" axis="0 0 1"\/>/' "$work/hangs.xml" >"$work/taut.xml"
"$cavort" new "$work/taut.xml" -o "$work/left.xml" >"$work/out" 2>"$work/err"
[ $? -eq 2 ] || fail "a string that no posture brings into its range passes"
grep -q "tendon 0 (no name), from site 'hook' to 'anchor' has length 0.1, outside its range 0 .. 0.02" "$work/err" || fail "which string is not told"
grep -q "left.xml is there all the same" "$work/err" && [ -s "$work/left.xml" ] || fail "the file is not left"

# of a file scene.xml, as those of many models are, the name of the model
sed 's/<mujoco model="[^"]*"/<mujoco model="tall man scene"/' problems/models/humanoid.xml >"$work/scene.xml"
"$cavort" new "$work/scene.xml" -o "$work/named.xml" -q && grep -q 'problem name="tall-man-first" model=' "$work/named.xml" || fail "the name of a scene"
# as another motion
"$cavort" new problems/models/humanoid.xml --like squat-jump -o "$work/like.xml" >"$work/out" || fail "like squat-jump"
grep -q 'problem name="humanoid-squat-jump" model=' "$work/like.xml" || fail "like squat-jump: its name"
"$cavort" inspect "$work/like.xml" >/dev/null 2>&1 || fail "like squat-jump cannot be read"
# a model without a floor gets one, where postures are put on it: beside what the scene has, and in a scene of its own
sed '/type="plane"/d' problems/models/humanoid.xml >"$work/floorless.xml"
grep -q 'type="plane"' problems/models/humanoid.xml || fail "the humanoid's file has a floor"
for motion in sit-stand squat-jump; do
  "$cavort" new "$work/floorless.xml" --like $motion -o "$work/$motion.xml" >/dev/null || fail "like $motion, without a floor"
  "$cavort" inspect "$work/$motion.xml" >"$work/out" 2>&1 || { fail "$motion without a floor"; cat "$work/out"; }
  grep -q "^  start .* touches the world with foot_right, foot_left" "$work/out" || fail "$motion does not stand on its floor"
  [ "$(grep -c 'name="floor" type="plane"' "$work/$motion.xml")" = 1 ] || fail "$motion has one floor"
done
"$cavort" new problems/models/humanoid.xml --like sit-stand -o "$work/floored.xml" >/dev/null || fail "like sit-stand"
grep -q 'type="plane"' "$work/floored.xml" && fail "a model with a floor gets another"
# from elsewhere, by a program in a build folder of the source
source=$(dirname "$(dirname "$(dirname "$cavort")")")
[ ! -d "$source/problems/motions" ] ||
  (cd "$work" && "$cavort" new "$root/problems/models/humanoid.xml" --like kick -o elsewhere.xml >/dev/null) || fail "like kick, from elsewhere"
"$cavort" new problems/models/robot.xml --like squat-jump -o "$work/no.xml" 2>"$work/err" && fail "like what does not fit"
grep -q "does not suit this model, nothing was written; these can be read with it: .*robot-jump" "$work/err" || fail "that nothing was written is not told"
grep -q "robot-jump, robot-reach, robot-squat" "$work/err" || fail "what fits is not told"
[ ! -e "$work/no.xml" ] || fail "what does not fit leaves a file"
"$cavort" new problems/models/robot.xml --like robot-sqat -o "$work/no.xml" 2>"$work/err" && fail "like nothing"
grep -q "did you mean 'robot-squat'" "$work/err" || fail "what was meant is not told"
"$cavort" new problems/models/arm.xml --like problems/motions/arm-reach/problem.xml -o "$work/file.xml" >/dev/null || fail "like a file"
"$cavort" new problems/models/robot.xml -o "$work/like.xml" 2>"$work/err" && fail "a file that is there is overwritten"
grep -q "is there already" "$work/err" || fail "a file that is there is not told"
"$cavort" new problems/motions/jump/problem.xml 2>"$work/err" && fail "a problem passes for a model"

# solved as they were written
for model in joint arm walker; do
  "$cavort" new problems/models/$model.xml -o "$work/$model.xml" -q || fail "new $model"
  CAVORT_THREE_JS=/nowhere "$cavort" solve "$work/$model.xml" -o "$work/$model.result" --threads 2 -q 2>/dev/null ||
    fail "$model is not certified as it was written"
done
[ "$failed" -eq 0 ] && echo "$number problems are read"
exit "$failed"
