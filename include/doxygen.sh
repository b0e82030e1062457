#!/bin/sh
# API documentation of the public headers by Doxygen, HTML and XML. Usage: sh include/doxygen.sh FOLDER. Fails where Doxygen warns or a
# name of the headers has no text, values of enumerations included, of which Doxygen does not speak. Exit status 77: no Doxygen here.
set -u
mkdir -p "${1:?usage: sh include/doxygen.sh FOLDER}" && out=$(cd "$1" && pwd) || exit 1
cd "$(dirname "$0")/.." || exit 1
command -v doxygen >/dev/null 2>&1 || { echo "no doxygen here (Debian: apt-get install doxygen)"; exit 77; }
{ cat include/Doxyfile && echo "OUTPUT_DIRECTORY = \"$out\""; } | doxygen - 2>"$out/warnings.txt" >/dev/null || { cat "$out/warnings.txt"; exit 1; }
# drawings need a program that is not asked for
if grep -v 'dot' "$out/warnings.txt" | grep -q .; then
  head -n 40 "$out/warnings.txt"
  exit 1
fi
exec python3 - "$out/xml" <<'TEXT'
import glob, sys
import xml.etree.ElementTree as tree
bare, named = [], 0
for path in glob.glob(sys.argv[1] + '/*.xml'):
    for kind in ('memberdef', 'enumvalue'):
        for member in tree.parse(path).iter(kind):
            name = member.find('name')
            if name is None or not name.text or (member.get('kind') == 'typedef') or name.text.startswith('@'):
                continue
            named += 1
            text = ''.join(t for part in ('briefdescription', 'detaileddescription') for t in member.find(part).itertext())
            # guards of headers, and what marks what is exported
            if not text.strip() and not name.text.startswith(('CAVORT_', 'CAV_API')):
                bare.append(name.text)
print('\n'.join('no text: ' + name for name in bare))
print('%d names, %d without a text' % (named, len(bare)))
sys.exit(1 if bare or named < 500 else 0)
TEXT
