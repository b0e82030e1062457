#!/bin/sh
# Arrows between rooms go one way: in each room, including a header of a room that it may not see has to fail, and of one
# that it may see has to work; no source leaves its room by a path with '..'. Usage: test_rooms.sh BUILD SOURCE
set -u
build=$1
source=$2
checks=0
failed=0
fail() {
  failed=$((failed + 1))
  echo "failed: $1"
}
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT

# one line a room: layer, room, the command that compiles one of its sources
python3 - "$build" "$source" >"$work/rooms" <<'TEXT'
import json, os, re, sys
build, source = sys.argv[1:]
seen = {}
for entry in json.load(open(os.path.join(build, 'compile_commands.json'))):
    path = os.path.relpath(os.path.join(entry['directory'], entry['file']), source)
    part = path.split('/')
    if len(part) == 3 and part[0] in ('dynamics', 'optim', 'problems') and part[2] not in ('main.c', 'embed.c'):
        flags = re.findall(r'(?:^| )(-I\S+|-std=\S+|-D\S+)', entry['command'])
        seen.setdefault((part[0], part[1]), ' '.join(f for f in flags if '"' not in f and "'" not in f))
for (layer, room), flags in sorted(seen.items()):
    print(layer, room, flags)
TEXT
[ -s "$work/rooms" ] || fail "no rooms found in $build/compile_commands.json"

while read -r layer room flags; do
  allowed=" $room "
  for flag in $flags; do
    case $flag in -I*/"$layer"/*) allowed="$allowed${flag##*/} " ;; esac
  done
  while read -r other_layer other other_flags; do
    [ "$other_layer" = "$layer" ] || continue
    header=$(ls "$source/$layer/$other"/*.h 2>/dev/null | head -n 1)
    [ -n "$header" ] || continue
    name=$(basename "$header")
    # two rooms may have headers of one name; then the path does not tell which is found
    [ "$(ls "$source"/dynamics/*/"$name" "$source"/optim/*/"$name" "$source"/problems/*/"$name" 2>/dev/null | wc -l)" -eq 1 ] || continue
    printf '#include "%s"\n' "$name" >"$work/try.c"
    checks=$((checks + 1))
    [ "$other" = "$room" ] && continue
    if (cd "$build" && cc $flags -w -fsyntax-only "$work/try.c") >"$work/log" 2>&1; then
      case $allowed in *" $other "*) ;; *) fail "$layer/$room may include $name of $other" ;; esac
    else
      case $allowed in *" $other "*) fail "$layer/$room cannot include $name of $other, which it sees" && sed 's/^/    /' "$work/log" ;; esac
    fi
  done <"$work/rooms"
done <"$work/rooms"

# arrows of the lists themselves: a room sees only rooms that stand before it
for layer in dynamics optim problems; do
  before=" "
  sed -n "s/^  '\([a-z]*\)': {$/room \1/p; s/^    'sees': \[\(.*\)\],$/sees \1/p" "$source/$layer/meson.build" | tr -d "',[]" >"$work/list"
  while read -r what rest; do
    if [ "$what" = room ]; then
      now=$rest
      continue
    fi
    for other in $rest; do
      checks=$((checks + 1))
      case $before in *" $other "*) ;; *) fail "$layer/$now sees $other, which comes after it" ;; esac
    done
    before="$before$now "
  done <"$work/list"
done

if grep -rnE '#include "\.\.?/' "$source/dynamics" "$source/optim" "$source/problems" --include='*.[ch]'; then fail "an include by path"; fi
if grep -rnE '^extern [^"]*\(' "$source/dynamics" "$source/optim" "$source/problems" --include='*.c'; then fail "a function declared by hand"; fi
checks=$((checks + 2))
echo "$checks checks, $failed failed"
[ "$failed" -eq 0 ] && [ "$checks" -gt 50 ]
