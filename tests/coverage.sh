#!/bin/sh
# Fraction of the lines of the library and the tool that the tests run. Usage: sh tests/coverage.sh [quick | TEST...], default all; quick
# leaves out those that take a minute or more in such a build: what it says is a lower bound. Builds with
# gcc and its counters into $CAVORT_BUILD (default build-coverage), runs the tests there and writes tests/results/coverage.md: a row
# a room. Lines are those with code, as gcov counts them; a line in several programs counts where any of them runs it.
set -eu
cd "$(dirname "$0")/.."

build=${CAVORT_BUILD:-build-coverage}
commit=$(git rev-parse --short HEAD)$(git diff --quiet HEAD -- dynamics optim problems || echo ' and changes')
[ -d "$build" ] || CC="${CC:-gcc}" meson setup "$build" . --buildtype=release -Db_coverage=true
meson compile -C "$build"
find "$build" -name '*.gcda' -delete

long="solve explain checker mesh analytic memory strategies stress report matrix resume ipopt optimum_ipopt interruption contact_suite python replay"
# and those that run no code of the library
other="documents text doxygen rooms const symbols page"
told=$*
if [ "$told" = quick ]; then
  set -- $(meson test -C "$build" --list 2>/dev/null | sed -n 's/^cavort.* \/ //p' | sort -u |
    while read -r name; do case " $long $other " in *" $name "*) ;; *) echo "$name" ;; esac; done)
fi
meson test -C "$build" --no-rebuild --timeout-multiplier 4 "$@" || echo "some tests failed: their lines count all the same"

python3 - "$build" "$told" "$commit" <<'TEXT'
import collections, json, os, subprocess, sys
build, chosen, commit = sys.argv[1:]
source = os.getcwd()
ran = collections.defaultdict(dict)
counters = [os.path.join(folder, name) for folder, _, names in os.walk(build) for name in names if name.endswith('.gcda')]
for counter in counters:
    done = subprocess.run(['gcov', '--json-format', '--stdout', os.path.abspath(counter)], cwd=build, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL)
    for text in done.stdout.decode().splitlines():
        for file in json.loads(text)['files']:
            path = os.path.relpath(os.path.join(build, file['file']), source)
            if path.split('/')[0] not in ('dynamics', 'optim', 'problems') or not path.endswith(('.c', '.h')):
                continue
            for line in file['lines']:
                at = line['line_number']
                ran[path][at] = ran[path].get(at, 0) or line['count']
rooms = collections.defaultdict(lambda: [0, 0])
for path, lines in ran.items():
    for name in ('/'.join(path.split('/')[:2]), path.split('/')[0], 'all'):
        rooms[name][0] += sum(count > 0 for count in lines.values())
        rooms[name][1] += len(lines)


def told(command):
    return subprocess.run(command, shell=True, stdout=subprocess.PIPE).stdout.decode().strip()


with open('tests/results/coverage.md', 'w') as out:
    out.write('# Lines that the tests run\n\n`sh tests/coverage.sh%s`, %s, commit %s.\n\n' %
              (' ' + chosen if chosen else '', told('gcc --version | head -n 1'), commit))
    out.write('| room | lines run | lines | fraction |\n|---|---|---|---|\n')
    for name in sorted(rooms, key=lambda n: (n == 'all', n)):
        run, lines = rooms[name]
        out.write('| %s | %d | %d | %.1f %% |\n' % (name, run, lines, 100 * run / lines))
print('%.1f %% of %d lines' % (100 * rooms['all'][0] / rooms['all'][1], rooms['all'][1]))
TEXT
