#!/bin/sh
# SONAME of the shared library that a program linked with -lLIBRARY would load. Usage: soname.sh LIBRARY COMPILER...
set -u
library=$1
shift
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
echo 'int main(void) { return 0; }' >"$work/probe.c"
"$@" "$work/probe.c" -o "$work/probe" -Wl,--no-as-needed "-l$library" || exit 1
# the libraries of the command come before the compiler's own
name=$(LC_ALL=C readelf -d "$work/probe" | sed -n 's/.*(NEEDED).*\[\(.*\)\]$/\1/p' | grep "^lib$library" | head -n 1)
[ -n "$name" ] || { echo "soname: no shared library for -l$library: install it, or switch the feature off" >&2; exit 1; }
printf '%s' "$name"
