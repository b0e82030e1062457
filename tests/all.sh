#!/bin/sh
# Every check of the project. Usage: sh tests/all.sh. Ends with one line, "N passed, N failed"; the exit status follows it.
# Installs what is missing, then: both compilers with warnings as errors, the tests of each, the second build with address and
# undefined-behaviour sanitizers (of debugging information the lines alone, which is what a finding names) and without those
# that solve whole motions (suite long); headers on their own as C and C++;
# layout of the text; installation and use through pkg-config, of the static and of the shared library.
# CAVORT_BUILD names the folder of the builds, by default build-ci.
set -u
cd "$(dirname "$0")/.." || exit 1

out=${CAVORT_BUILD:-build-ci}
mkdir -p "$out" && out=$(cd "$out" && pwd) || exit 1
rm -f "$out/failures.txt"
passed=0
failed=0
skipped=0

# what is undefined about pointers is left to AddressSanitizer, which sees what comes of it: with these checks clang takes eight
# times as long over files of vectors
pointers=-fno-sanitize=null,alignment,object-size,pointer-overflow
# the sanitizers' findings end a test
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ASAN_OPTIONS=detect_leaks=1

# check NAME COMMAND...: one check; what it prints is shown only where it fails
check() {
  name=$1
  shift
  start=$(date +%s)
  if "$@" >"$out/check.log" 2>&1; then
    passed=$((passed + 1))
    echo "ok       $name ($(($(date +%s) - start)) s)"
  else
    failed=$((failed + 1))
    echo "FAILED   $name ($(($(date +%s) - start)) s)"
    # of a build the errors, which are among much else
    grep -E 'error:|FAILED' "$out/check.log" | head -n 20 | sed 's/^/    /'
    tail -n 60 "$out/check.log" | sed 's/^/    /'
    return 1
  fi
}

# build NAME COMPILER OPTION...: a build folder from nothing, warnings are errors
build() {
  folder=$out/$1
  compiler=$2
  shift 2
  rm -rf "$folder"
  CC=$compiler meson setup "$folder" . -Dwerror=true "$@" && meson compile -C "$folder" --ninja-args=-k0
}

# tests NAME: the tests of one build, each counted
tests() {
  folder=$out/$1
  start=$(date +%s)
  shift
  meson test -C "$folder" --no-rebuild --print-errorlogs "$@" >"$folder/tests.log" 2>&1
  status=$?
  count() { sed -n "s/^$1: *\([0-9][0-9]*\).*/\1/p" "$folder/tests.log" | tail -n 1; }
  good=$(($(count Ok) + $(count 'Expected Fail')))
  bad=$(($(count Fail) + $(count Timeout) + $(count 'Unexpected Pass')))
  left=$(count Skipped)
  # a run that broke off has no count of its own
  [ "$status" -ne 0 ] && [ "$bad" -eq 0 ] && bad=1
  [ "$good" -eq 0 ] && [ "$bad" -eq 0 ] && bad=1
  passed=$((passed + good))
  failed=$((failed + bad))
  skipped=$((skipped + ${left:-0}))
  took=$(($(date +%s) - start))
  if [ "$bad" -eq 0 ]; then
    echo "ok       $good tests of this build ($took s)"
  else
    echo "FAILED   $bad of $((good + bad)) tests of this build ($took s), what they printed is below"
    failures "$folder" >>"$out/failures.txt"
  fi
}

# failures FOLDER: name and last words of each test of a build that did not pass
failures() {
  python3 - "$1/meson-logs/testlog.json" <<'TEXT'
import json, sys
for line in open(sys.argv[1]):
    test = json.loads(line)
    if test['result'] in ('OK', 'SKIP', 'EXPECTEDFAIL'):
        continue
    print('%s: %s, exit status %s: %s' % (test['result'], test['name'], test['returncode'], ' '.join(test['command'])))
    words = (test.get('stdout', '') + test.get('stderr', '')).splitlines()
    told = [word for word in words if 'failed:' in word or 'ERROR' in word]
    for word in told[:20] + ['...'] + words[-20:]:
        print('    ' + word[:300])
TEXT
}

# every public header compiles on its own
headers() {
  for header in include/cavort/*.h; do
    gcc -std=c17 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -Iinclude -x c "$header" || return 1
    g++ -std=c++17 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -Iinclude -x c++ "$header" || return 1
  done
}

layout() { find include dynamics optim problems tests -name '*.[ch]' -exec clang-format --dry-run -Werror {} +; }

# the same build with a shared library in the place of the static one, of the same objects
shared() { meson configure "$out/gcc" -Ddefault_library=shared -Dtests=false && meson compile -C "$out/gcc" --ninja-args=-k0; }

# installed KIND: the gcc build installed into a folder of its own, then used by a program that knows nothing but pkg-config
installed() {
  root=$out/root-$1
  rm -rf "$root"
  DESTDIR=$root meson install -C "$out/gcc" --no-rebuild || return 1
  folder=$(dirname "$(find "$root" -name cavort.pc)")
  prefix=$root$(sed -n 's/^prefix=//p' "$folder/cavort.pc")
  cat >"$out/user.c" <<'TEXT'
#include <cavort/cavort.h>
#include <stdio.h>
int main(void) {
  cav_error error = {0};
  cav_model *model = cav_model_load("/nowhere/none.xml", &error);
  printf("cavort %s: %s\n", cav_version(), error.text);
  cav_model_free(model);
  return model != NULL || error.status != CAV_BAD_INPUT;
}
TEXT
  flags=$(PKG_CONFIG_PATH=$folder pkg-config --define-variable=prefix="$prefix" --cflags --libs cavort) || return 1
  # a shared library is found where it was installed to
  run="env LD_LIBRARY_PATH=$(dirname "$folder")"
  gcc -std=c17 -Wall -Werror "$out/user.c" -o "$out/user" $flags && $run "$out/user" && "$prefix/bin/cavort" help || return 1
  gcc -std=c17 -Wall -Wextra -Werror problems/example.c -o "$out/example" $flags && $run "$out/example" || return 1
  gcc -std=c17 -Wall -Wextra -Werror problems/example_replan.c -o "$out/replan" $flags && $run "$out/replan" || return 1
  gcc -std=c17 -Wall -Wextra -Werror problems/example_mpc.c -o "$out/mpc" $flags && $run "$out/mpc" | grep -q 'it stands' || return 1
  gcc -std=c17 -Wall -Wextra -Werror problems/example_mhe.c -o "$out/mhe" $flags && $run "$out/mhe" | grep -q 'followed to the end' || return 1
  # as it was installed
  gcc -std=c17 -Wall -Wextra -Werror "$prefix/share/cavort/examples/example_term.c" -o "$out/term" $flags -lm && $run "$out/term"
}

# the Python package installed beside the shared library, then a wheel of its own around that library, and a line that uses it
python_package() {
  python=/usr/bin/python3
  [ -x "$python" ] || python=python3
  root=$out/root-shared
  folder=$(dirname "$(find "$root" -name cavort.pc)")
  prefix=$root$(sed -n 's/^prefix=//p' "$folder/cavort.pc")
  line='import cavort; print(cavort.__file__, cavort.Model("problems/models/humanoid.xml"))'
  PYTHONPATH=$(dirname "$(dirname "$(find "$root" -name _interface.py)")") "$python" -c "$line" || return 1
  rm -rf "$out/wheel" "$out/site" "$out/package"
  cp -r problems/python "$out/package" && mkdir "$out/wheel" || return 1
  PKG_CONFIG="env PKG_CONFIG_PATH=$folder pkg-config --define-variable=prefix=$prefix" \
    "$python" -m pip wheel "$out/package" --no-build-isolation --no-deps --no-index -w "$out/wheel" -q &&
    "$python" -m pip install --no-deps --no-index --target "$out/site" -q "$out"/wheel/cavort-*-py3-none-*.whl &&
    PYTHONPATH=$out/site "$python" -c "$line" | grep -F "$out/site"
}

# the example of README.md is the file that was just built
example() { awk '/^```$/ { on = 0 } on { print } /^```c$/ { on = 1 }' README.md | cmp - problems/example.c; }

if sh problems/install.sh test; then
  check "build, gcc" build gcc gcc --buildtype=release && tests gcc
  check "build, clang with sanitizers" build clang clang --buildtype=debugoptimized -Db_sanitize=address,undefined \
    -Db_lundef=false "-Dc_args=['-g1', '$pointers']" &&
    tests clang --timeout-multiplier 6 --no-suite long
  check "headers alone, C17 and C++17" headers
  if command -v clang-format >/dev/null 2>&1; then
    check "layout of the text" layout
  else
    skipped=$((skipped + 1))
    echo "skipped  layout of the text: no clang-format here"
  fi
  check "install, pkg-config, the example" installed static
  check "shared library: build" shared && tests gcc symbols python &&
    check "shared library: install, pkg-config, the example" installed shared &&
    check "Python: install, wheel, a line that uses it" python_package
  check "the example as README.md has it" example
else
  failed=1
fi

[ -s "$out/failures.txt" ] && cat "$out/failures.txt"
[ "$skipped" -gt 0 ] && echo "$skipped skipped"
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
