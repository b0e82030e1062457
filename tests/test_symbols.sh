#!/bin/sh
# What the library exports is what the public headers declare, both ways, and a shared library has the name of its interface:
# major version, before 1.0 major and minor. Usage: test_symbols.sh LIBRARY SOURCE VERSION, where LIBRARY is
# libcavort.so.VERSION or libcavort.a; of an archive, what a link of its objects into a shared library would export
set -u
library=$1
source=$2
version=$3
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT

# functions of the headers: names before an opening bracket at the start of a declaration, without comments and macros
python3 - "$source"/include/cavort/*.h >"$work/declared" <<'TEXT'
import re, sys
names = set()
for path in sys.argv[1:]:
    text = re.sub(r'//[^\n]*|/\*.*?\*/', '', open(path).read(), flags=re.S)
    text = re.sub(r'^#(?:[^\n]*\\\n)*[^\n]*$', '', text, flags=re.M).replace('extern "C" {', ';')
    # blocks in braces hold no declarations of functions
    while re.search(r'\{[^{}]*\}', text):
        text = re.sub(r'\{[^{}]*\}', '', text)
    for statement in text.split(';'):
        found = re.match(r'(?!typedef\b)[\w\s*]*?\b(\w+)\s*\(', statement.strip())
        if found:
            names.add(found.group(1))
print('\n'.join(sorted(names)))
TEXT

case $library in
  *.a)
    # a symbol that any object defines, global and not hidden; names with two underscores are the compiler's
    readelf -sW "$library" | awk '($5 == "GLOBAL" || $5 == "WEAK") && $6 != "HIDDEN" && $6 != "INTERNAL" && $7 != "UND" { print $8 }' ;;
  *)
    nm -D --defined-only "$library" | awk '{ print $3 }' ;;
esac | grep -v '^__' | LC_ALL=C sort -u >"$work/exported"
LC_ALL=C sort -u "$work/declared" -o "$work/declared"

count=$(wc -l <"$work/exported")
failed=0
for name in $(comm -23 "$work/declared" "$work/exported"); do
  echo "failed: $name is declared in include/cavort and not exported" && failed=$((failed + 1))
done
for name in $(comm -13 "$work/declared" "$work/exported"); do
  echo "failed: $name is exported and not declared in include/cavort" && failed=$((failed + 1))
done
case $library in
  *.a) ;;
  *)
    # two links lead to the file: one that programs are started with, one that they are built with
    major=${version%%.*} rest=${version#*.}
    interface=$major
    [ "$major" = 0 ] && interface=0.${rest%%.*}
    name=$(readelf -d "$library" | sed -n 's/.*(SONAME).*\[\(.*\)\]/\1/p')
    [ "$name" = "libcavort.so.$interface" ] ||
      { echo "failed: the library calls itself '$name', not libcavort.so.$interface" && failed=$((failed + 1)); }
    for link in "$name" libcavort.so; do
      [ "$(readlink -f "$(dirname "$library")/$link")" = "$(readlink -f "$library")" ] &&
        [ "${library##*/}" = "libcavort.so.$version" ] ||
        { echo "failed: $link does not lead to libcavort.so.$version" && failed=$((failed + 1)); }
    done ;;
esac
echo "$count symbols, $failed failed"
[ "$failed" -eq 0 ] && [ "$count" -gt 50 ]
