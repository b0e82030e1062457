#!/bin/sh
# Which model files of some folders load unedited: a table of them with what stops the rest, as markdown.
#
#   sh tests/models.sh [-b CAVORT] FOLDER... > table.md
#
# CAVORT: the tool to ask (default: build/problems/cavort). Files: *.xml that have <mujoco> in them, *.urdf. Where
# CAVORT_MUJOCO_JS names the mujoco.js of @mujoco/mujoco, MuJoCo 3 is asked too.
set -u
here=$(cd "$(dirname "$0")/.." && pwd)
tool=$here/build/problems/cavort
if [ "${1:-}" = -b ]; then
  tool=$2
  shift 2
fi
[ $# -gt 0 ] || { sed -n '3,9s/^# \{0,1\}//p' "$0"; exit 2; }
list=$(mktemp)
trap 'rm -f "$list"' EXIT
echo '| file | cavort | MuJoCo 3 | why not |'
echo '|---|---|---|---|'
for folder; do
  find "$folder" \( -name '*.xml' -o -name '*.urdf' \) -type f | sort > "$list"
  loaded=0 files=0
  while IFS= read -r file; do
    case $file in *.xml) grep -q '<mujoco' "$file" || continue ;; esac
    files=$((files + 1)) peer=- ours=yes
    why=$(timeout 120 "$tool" inspect "$file" 2>&1 > /dev/null) || ours=no
    [ $ours = yes ] && why= && loaded=$((loaded + 1))
    case $file in
      *.xml)
        if [ -n "${CAVORT_MUJOCO_JS:-}" ]; then
          peer=yes
          timeout 120 node "$here/tests/peer_mujoco3.mjs" "$file" > /dev/null 2>&1 < /dev/null || peer=no
        fi
        ;;
    esac
    why=$(printf '%s' "$why" | head -1 | sed "s#^cavort: ##; s#$folder/*##g; s#|#/#g" | cut -c1-160)
    printf '| %s | %s | %s | %s |\n' "${file#"$folder"/}" $ours $peer "$why"
  done < "$list"
  printf '| **%s** | **%d of %d** | | |\n' "$(basename "$folder")" $loaded $files
done
