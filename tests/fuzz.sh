#!/bin/sh
# Runs the six fuzzers of the readers, two at a time, and writes tests/results/fuzz.txt. Needs clang. Usage:
#   sh tests/fuzz.sh SECONDS          each for that long; what they find and their logs stay in build-fuzz/found
#   sh tests/fuzz.sh table FOLDER     the table alone, from the logs in a folder (NAME.log, and NAME.*.log of further runs)
set -eu
cd "$(dirname "$0")/.."

names="mjcf urdf stl obj clip problem"
found=build-fuzz/found

# what a fuzzer starts from beside its corpus: for problems those of the motions, and broken models
seeds() {
  mkdir -p "$found/seeds.$1"
  [ "$1" = problem ] || return 0
  for motion in problems/motions/*; do cp "$motion/problem.xml" "$found/seeds.$1/$(basename "$motion").xml"; done
  cp tests/broken/*.xml "$found/seeds.$1"
}

# one fuzzer; what libFuzzer keeps, crash-*, timeout-* and so on, is a finding
fuzz() {
  mkdir -p "$found/$1"
  seeds "$1"
  [ -f "tests/fuzz/$1.dict" ] && words="-dict=tests/fuzz/$1.dict" || words=
  # shellcheck disable=SC2086
  nice -n 19 "build-fuzz/tests/fuzz_$1" -seed=1 -max_total_time="$2" -max_len=4096 -timeout=60 -print_final_stats=1 $words \
    -artifact_prefix="$found/$1." "$found/$1" "tests/fuzz/$1" "$found/seeds.$1" >"$found/$1.log" 2>&1 || echo "fuzz: $1 ended with a finding"
}

# executions and seconds over the logs of a fuzzer; one that is interrupted tells its rate alone
work_of() {
  cat "$1/$2".log "$1/$2".*.log 2>/dev/null | awk '/number_of_executed_units/ { n = $2 } /average_exec_per_sec/ { runs += n; s += n / $2 }
    END { printf "%9.0f  %10d", s, runs }'
}

table() {
  echo "sh tests/fuzz.sh SECONDS"
  echo
  echo "machine   $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) cores"
  echo "compiler  $(clang --version | head -n 1), libFuzzer with address and undefined-behaviour sanitizers"
  echo "commit    $(git rev-parse --short HEAD)"
  echo
  echo "reader     seconds  executions  coverage (edges)  corpus found  committed corpus  findings"
  for name in $names; do
    last=$(grep -h 'cov:' "$1/$name.log" | tail -n 1)
    findings=$(find "$1" -maxdepth 1 -name "$name.*-*" | wc -l)
    printf '%-7s %s  %16s  %12s  %16s  %8s\n' "$name" "$(work_of "$1" "$name")" \
      "$(echo "$last" | sed 's/.*cov: \([0-9]*\).*/\1/')" "$(echo "$last" | sed 's/.*corp: \([0-9]*\).*/\1/')" \
      "$(ls "tests/fuzz/$name" | wc -l) ($(cat tests/fuzz/"$name"/* | wc -c) B)" "$findings"
  done
}

case "${1:-}" in
  table) table "$2" ;;
  *[!0-9]* | '') echo "usage: sh tests/fuzz.sh SECONDS | table FOLDER" >&2 && exit 2 ;;
  *)
    [ -d build-fuzz ] || CC=clang meson setup build-fuzz -Dfuzz=enabled -Db_sanitize=address,undefined -Db_lundef=false \
      --buildtype=debugoptimized >/dev/null
    for name in $names; do ninja -C build-fuzz "tests/fuzz_$name" >/dev/null; done
    rm -rf "$found"
    { fuzz mjcf "$1" && fuzz stl "$1" && fuzz problem "$1"; } &
    fuzz urdf "$1" && fuzz obj "$1" && fuzz clip "$1"
    wait
    table "$found" >tests/results/fuzz.txt
    ;;
esac
