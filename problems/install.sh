#!/bin/sh
# Installs the Debian packages that are missing. Usage: sh problems/install.sh build|test
#   build: what the tool needs; test: the same, and what the tests need
# Prints nothing when nothing is missing. Fails with the list of packages when it may not install them.
set -u

build="gcc libc6-dev meson ninja-build pkg-config libxml2-dev libopenblas-serial-dev libsuitesparse-dev coinor-libipopt-dev libccd-dev libqhull-dev libpng-dev libassimp-dev libjs-three"
test="g++ clang libclang-rt-14-dev clang-format libmujoco-dev gnuplot-nox python3-numpy python3-cffi python3-pytest python3-pip python3-setuptools python3-wheel mypy libxml2-utils doxygen"

case "${1:-}" in
  build) wanted=$build ;;
  test) wanted="$build $test" ;;
  *) echo "usage: sh problems/install.sh build|test" >&2; exit 2 ;;
esac

# elsewhere than on Debian and its kin: meson says what it misses
if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
  echo "install: no apt-get here; going on with what is installed. Debian's names for what is needed: $wanted"
  exit 0
fi

missing=""
for package in $wanted; do
  state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) || state=none
  [ "$state" = installed ] || missing="$missing $package"
done
[ -z "$missing" ] && exit 0

# who may install
if [ "$(id -u)" -eq 0 ]; then
  as=""
elif command -v sudo >/dev/null 2>&1 && { [ -t 0 ] || sudo -n true 2>/dev/null; }; then
  as="sudo"
else
  echo "install: these packages are missing and only root can add them. Run as root:" >&2
  echo "  apt-get update && apt-get install --no-install-recommends -y$missing" >&2
  exit 1
fi

# mirrors fail now and then: three tries
echo "install:$missing"
try=1
while :; do
  if $as env DEBIAN_FRONTEND=noninteractive sh -c "apt-get update -q && apt-get install -q -y --no-install-recommends $missing" \
      >"${TMPDIR:-/tmp}/cavort-install.$$" 2>&1; then
    rm -f "${TMPDIR:-/tmp}/cavort-install.$$"
    exit 0
  fi
  if [ "$try" -ge 3 ]; then
    tail -n 20 "${TMPDIR:-/tmp}/cavort-install.$$" >&2
    rm -f "${TMPDIR:-/tmp}/cavort-install.$$"
    echo "install: apt-get failed three times (its last lines are above). Install by hand:$missing" >&2
    exit 1
  fi
  try=$((try + 1))
  sleep $((5 * try))
done
