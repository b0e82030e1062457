#!/bin/sh
# A function that takes a const state writes to nothing of it, not through its pointers either: compiled against headers in which
# all that a state's pointers point to is const, no such function may complain. Usage: test_const.sh SOURCE
set -u
source=$1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cp -r "$source/include" "$source/dynamics" "$work" && cd "$work" || exit 1
exec python3 - <<'TEXT'
import glob, re, subprocess, sys

def harden(path, name):
    text = open(path).read()
    first = text.index(f'typedef struct {name} {{')
    last = text.index(f'}} {name};')
    lines = [re.sub(r'^(\s+)(?!const )((?:struct )?\w+)( [^;/]*\*[^;]*;.*)$', r'\1const \2\3', line)
             for line in text[first:last].split('\n')]
    open(path, 'w').write(text[:first] + '\n'.join(lines) + text[last:])

harden('include/cavort/dynamics.h', 'cav_state')
harden('dynamics/state/workspace.h', 'cav_workspace')
harden('dynamics/state/derivative_store.h', 'cav_derivative_store')

rooms = ['-I' + room for room in glob.glob('dynamics/*/')]
checks = failed = 0
for path in sorted(glob.glob('dynamics/*/*.c')):
    text = open(path).read()
    functions = {name for name, parameters in re.findall(r'^\w[^\n;{}]*?\b(\w+)\(([^;{}]*?)\)\s*\{', text, re.M)
                 if 'const cav_state' in parameters}
    if not functions:
        continue
    checks += len(functions)
    said = subprocess.run(['cc', '-std=gnu17', '-Iinclude', *rooms, '-Wall', '-fsyntax-only', '-fdiagnostics-color=never', path],
                          capture_output=True, text=True, env={'LC_ALL': 'C', 'PATH': '/usr/local/bin:/usr/bin:/bin'}).stderr
    where = ''
    for line in said.split('\n'):
        function = re.search(r"In function '(\w+)'", line)
        where = function.group(1) if function else where
        if where in functions and re.search(r'error: assignment of read-only|discards .*const', line):
            failed += 1
            print(f'failed: {where} takes a const state and writes: {line}')
    # a cast would hide it
    for line in re.findall(r'^.*\(cav_(?:state|workspace) \*\)state.*$', text, re.M):
        failed += 1
        print(f'failed: {path} casts const away: {line.strip()}')
print(f'{checks} functions, {failed} failed')
sys.exit(failed > 0 or checks < 50)
TEXT
