# What tests of the command share, read by them with the arguments CAVORT SOURCE_ROOT: a folder of their own to work in, which goes
# in the end, and checks that are counted. A failed one shows what the command wrote last.
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$(cd "$2" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
checks=0
failed=0

# check TEXT COMMAND...: one check
check() {
  text=$1
  shift
  checks=$((checks + 1))
  "$@" && return 0
  failed=$((failed + 1))
  echo "failed: $text"
  sed 's/^/    /' out err 2>/dev/null | head -n 20
}

# run STATUS ARGUMENT...: the command ends with that status; out and err keep what it wrote
run() {
  wanted=$1
  shift
  "$cavort" "$@" >out 2>err
  status=$?
  check "cavort $*: status $status, expected $wanted" [ "$status" -eq "$wanted" ]
}

# of a file, by its name
says() { check "$1 says: $2" grep -qF -- "$2" "$1"; }
silent() { check "$1 is empty" [ ! -s "$1" ]; }
has() { check "$1 exists" [ -s "$1" ]; }
