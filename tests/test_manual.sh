#!/bin/sh
# What the tool prints of itself. Usage: test_manual.sh TOOL SOURCE. The committed reference is the one that is printed; the
# schema takes every problem file of the repository and refuses what the reader refuses for a name, a word or a number; the man
# page renders without a warning; completion completes. What a program is missing for is said, and not checked.
set -u
tool=$1
source=$2
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
checks=0
failed=0
check() {
  text=$1
  shift
  checks=$((checks + 1))
  "$@" >"$folder/told" 2>&1 && return
  failed=$((failed + 1))
  echo "failed: $text"
  head -n 12 "$folder/told" | sed 's/^/    /'
}
not() { ! "$@"; }

# --- the reference ---

"$tool" help reference >"$folder/reference.md"
check "problems/reference.md is what cavort help reference prints: record it anew" \
  diff "$folder/reference.md" "$source/problems/reference.md"
for command in $("$tool" help | sed -n 's/^cavort \([a-z]*\) .*/\1/p'); do
  [ "$command" = cavort ] || check "$command has a section" grep -q "^### cavort $command " "$folder/reference.md"
done

# --- words that name nothing here ---

says() { "$tool" help "$1" | grep -qF -- "$2"; }
tells() { "$tool" "$1" 2>&1 | grep -qF -- "$2"; }
while IFS='|' read -r word line; do
  check "no command '$word': cavort $line" tells "$word" "there is no command '$word'; cavort $line "
  check "nor help of it" says "$word" "cavort $line"
done <<'TEXT'
check|inspect PROBLEM
validate|inspect PROBLEM
info|inspect PROBLEM
plan|solve PROBLEM
optimise|solve PROBLEM
optimize|solve PROBLEM
play|view DIR
plot|view DIR
open|view DIR
create|new MODEL
TEXT
check "simulate" tells simulate "cavort mpc PROBLEM"
check "a word that no one knows is left alone" not tells fly "; cavort "
check "spelling still counts" tells expain "did you mean 'explain'?"
for word in torso 'right hand' hand foot pelvis; do
  check "$word is a role" says "$word" "$word: a role"
  check "$word leads to the roles" says "$word" "  back left foot"
done
check "a posture by its name" says kneel "kneel: a posture of any humanoid"
check "with the others" says kneel "  all-fours"
check "a role by its own name" says hand 'body="hand"'
for word in achieved certified optimal stand keyframe axis floor knee dt tolerance units left catch rolling root_angular principal stop limit fast \
  minimum lock handle; do
  check "help of $word" says "$word" "$word: "
done
check "what is meant comes first" sh -c "'$tool' help floor | head -n 1 | grep -q '^floor: .*<scene>'"
# all that the list of words leads to is there
sed -n 's/^ *{"\([^"]*|[^"]*\)".*/\1/p' "$source/problems/manual/words.c" | tr '|' '\n' >"$folder/words"
check "there are words" [ "$(wc -l <"$folder/words")" -gt 150 ]
while read -r word; do
  [ -n "$word" ] || continue
  "$tool" help "$word" >"$folder/answer" 2>&1 || { check "help $word" false; continue; }
  see=$(sed -n 's/^  more: cavort help //p' "$folder/answer")
  [ -z "$see" ] || check "$word leads to $see" "$tool" help "$see"
  use=$(sed -n "s/^$word: cavort \([a-z]*\) .*/\1/p" "$folder/answer")
  [ -z "$use" ] || check "$word is the command $use" "$tool" help "$use"
  check "help $word in 130 columns" not grep -qE "^($word: |  [a-z<]).{130}" "$folder/answer"
done <"$folder/words"

# --- attributes by their names: all that have them, and what is chosen among several ---

for word in lower upper; do
  check "who has $word" says "$word" "attribute $word of <sensor> <posture> <velocity> <acceleration> in <constraint>"
done
check "a name is told once" says xbody "attribute xbody of <sensor>"
check "and no more" not says xbody "<sensor> <sensor>"
for word in body xbody geom site; do
  check "one of several objects: $word" says "$word" "give exactly one of body, xbody, geom, site, joint, tendon, actuator"
done
check "no default is another object" not says xbody "default: "
check "one of three" says degrees "give exactly one of pos, degrees, quat"
for word in force gap impact clearance edge_force self_force self_penetration; do
  check "$word has no tolerance" sh -c "! '$tool' help $word | grep -q '^  within '"
done
check "slip has one" says slip "  within "
check "order, axes and units of qvel" says qvel "in the order of the joints of the model and then of the <scene> (inspect --all lists them); a free joint has 3 in m/s along the world's axes and then 3 in rad/s about its body's own"
for word in velocity posture acceleration; do
  check "$word of one joint replaces the defaults" says "$word" "a cost of it over the whole motion takes the place of the default costs of its kind, which are of all joints"
done
check "roots are those of things, too" says dofs "of things of the scene, too: joints are all but free joints, driven those of them in trees that an actuator moves, root_linear and root_angular"
check "what a body is put down on" says height "on what stands in the way down, or on the solid that it begins inside with its centre over that"
check "principal axes of a body" says body "along its principal axes of inertia, which may be turned from its own"
check "who has a tolerance" says within "attribute within of <sensor> <posture> <velocity> <acceleration> <effort> <power>"

check "the convention of axes" says pos "z is up, of most robots +x forwards and +y to the left"
check "which way angles count" says euler "about x, then the new y, then the new z, each right-handed: 0 0 90 is turned to the left"
check "usual weights" says weight "goals usually take 500 to 5000, costs over the motion 0.01 to 10"
check "what all constraints have" says constraint "within, lower, upper"
check "what MJCF has in a scene is not told" says scene "holds <geom>"
check "what is expected is within or a constraint" says expect "<constraint>, with lower=, upper= or within="
check "joints over a named posture" says key "<joint> and <root> inside lie over it"

# --- the schema ---

if command -v xmllint >/dev/null 2>&1; then
  "$tool" help xsd >"$folder/problem.xsd"
  by_schema() { xmllint --noout --schema "$folder/problem.xsd" "$1"; }
  n=0
  for file in $(find "$source/problems" "$source/tests" -name '*.xml'); do
    grep -q '<problem' "$file" || continue
    # the corpus of the fuzzer holds names of earlier versions, on purpose
    case $file in */fuzz/*) continue ;; esac
    n=$((n + 1))
    check "$file against the schema" by_schema "$file"
  done
  check "there are problem files" [ "$n" -gt 25 ]

  # one fault in a file that is right: refused by the reader and by the schema
  cp "$source/tests/rise_model.xml" "$folder/model.xml"
  cat >"$folder/right.xml" <<'TEXT'
<problem name="right" model="model.xml"><horizon duration="1" timestep="0.05" order="euler"/>
<start><joint name="pivot" pos="0.1"/></start><guess apex="0"><swing joint="pivot" amplitude="1" frequency="1"/></guess>
<cost><posture at="end" weight="3" dofs="all"/><effort weight="1"/></cost>
<schedule stages="4"><first softness="1"/></schedule></problem>
TEXT
  by_reader() { "$tool" inspect "$1"; }
  check "a right file, by the reader" by_reader "$folder/right.xml"
  check "a right file, by the schema" by_schema "$folder/right.xml"
  while IFS='|' read -r what command; do
    sed "$command" "$folder/right.xml" >"$folder/wrong.xml"
    check "a fault is made: $what" not cmp -s "$folder/right.xml" "$folder/wrong.xml"
    check "the reader refuses $what" not by_reader "$folder/wrong.xml"
    check "the schema refuses $what" not by_schema "$folder/wrong.xml"
  done <<'TEXT'
an attribute that there is not|s/timestep=/timestap=/
an attribute of the root|s/name="right"/nome="right"/
an attribute of a term|s/dofs="all"/dof="all"/
an element|s/<effort/<efort/
an element in the wrong place|s/<swing/<horizon/
a word|s/order="euler"/order="heun"/
another word|s/dofs="all"/dofs="most"/
too many numbers|s/pos="0.1"/pos="0.1 0.2"/
no number|s/weight="3"/weight="much"/
a hexadecimal number|s/weight="3"/weight="0x3"/
a number that is not finite|s/weight="3"/weight="inf"/
a fraction of a stage|s/stages="4"/stages="4.5"/
a missing attribute|s/ duration="1"//
a missing weight|s/<effort weight="1"/<effort/
a missing name|s/<joint name="pivot"/<joint/
an empty text|s/joint name="pivot"/joint name=""/
a stage twice|s/<first softness="1"\/>/<first softness="1"\/><first softness="2"\/>/
TEXT
else
  echo "no xmllint here: the schema is not checked"
fi

# --- the man page ---

if command -v groff >/dev/null 2>&1; then
  "$tool" help man >"$folder/cavort.1"
  check "the man page renders" sh -c "groff -man -ww -Tascii -P-c -P-b '$folder/cavort.1' 2>'$folder/warnings' | grep -q 'cavort solve'"
  check "without a warning" not test -s "$folder/warnings"
else
  echo "no groff here: the man page is not rendered"
fi

# --- completion ---

if command -v bash >/dev/null 2>&1; then
  "$tool" help bash >"$folder/cavort.bash"
  # what completes the last of some words
  complete() {
    bash -c 'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _cavort; echo "${COMPREPLY[*]}"' \
      bash "$folder/cavort.bash" "$@"
  }
  check "commands" test "$(complete cavort so)" = solve
  check "options" test "$(complete cavort solve --str)" = --strategies
  check "no option of another command" test -z "$(complete cavort solve --quick)"
  check "words of an option" test "$(complete cavort solve --solver ip)" = ipopt
  check "topics" test "$(complete cavort help sche)" = schedule
  check "files" test "$(cd "$folder" && complete cavort inspect mod)" = "$([ -f "$folder/model.xml" ] && echo model.xml)"
else
  echo "no bash here: its completion is not checked"
fi
if command -v zsh >/dev/null 2>&1; then
  "$tool" help zsh >"$folder/_cavort"
  check "completion for zsh" zsh -n "$folder/_cavort"
else
  echo "no zsh here: its completion is not checked"
fi

echo "$checks checks, $failed failed"
[ "$failed" -eq 0 ] && [ "$checks" -gt 10 ]
