#!/bin/sh
# Solves every motion of problems/motions in a build with asserts and the address and undefined-behaviour sanitizers, by the stated
# guess alone, each for a bounded time, after which it is interrupted and verifies what it has. Fails where an assert or a
# sanitizer speaks; whether a motion is certified is no matter here. Usage:
#   sh tests/debug.sh [BUILD [SECONDS [MOTION...]]]   (default: build-debug, made where it is absent; 60 s a motion)
set -u
cd "$(dirname "$0")/.."
build=${1:-build-debug}
seconds=${2:-60}
[ $# -lt 2 ] || shift
[ $# -eq 0 ] || shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

[ -d "$build" ] || meson setup "$build" --buildtype=debugoptimized -Db_ndebug=false -Db_sanitize=address,undefined \
  -Db_lundef=false >/dev/null || exit 1
ninja -C "$build" problems/cavort >/dev/null || exit 1
# asserts are silent where they are switched off: the build has to have them
meson introspect --buildoptions "$build" | tr '{' '\n' | grep -q '"name": "b_ndebug", "value": "false"' || {
  echo "$build: has no asserts; set it up with -Db_ndebug=false"
  exit 1
}
# an exit status of its own for sanitizers: 1 says not certified
export ASAN_OPTIONS=exitcode=77 UBSAN_OPTIONS=halt_on_error=1:exitcode=77

for motion in ${*:-$(ls problems/motions)}; do
  file=problems/motions/$motion/problem.xml
  timeout -s INT -k 300 "$seconds" "$build/problems/cavort" solve "$file" -o "$work/out" --threads 1 --strategies 1 --quiet \
    2>"$work/log"
  status=$?
  # certified, not certified, interrupted (by us: 124 of timeout)
  case $status in
    0) echo "$motion: ok, certified" ;;
    1) echo "$motion: ok, not certified" ;;
    124 | 130) echo "$motion: ok, interrupted after $seconds s" ;;
    *)
      echo "$motion: FAILED with status $status"
      cat "$work/log"
      failed=$((failed + 1))
      ;;
  esac
  # timeout tells of the interruption, not of what came after it
  if grep -qE 'Sanitizer|runtime error|Assertion' "$work/log" && [ "$status" -eq 124 ]; then
    echo "$motion: FAILED after the interruption"
    cat "$work/log"
    failed=$((failed + 1))
  fi
done
echo "$failed failed"
[ "$failed" -eq 0 ]
