#!/bin/sh
# Solves that are killed (SIGKILL) or interrupted (SIGINT, SIGTERM, SIGHUP in turn) at random moments: what is left can be read,
# interruption is answered within a second, and going on ends with the certificate of the solve that was left alone, strategies
# of the problem included. Usage: interruption.sh CAVORT PROBLEM KILLS INTERRUPTIONS [SEED [ARGUMENT...]]; arguments go to cavort solve.
# CAVORT_ANSWER: the seconds to answer in, by default 1 (sanitizers slow a program down).
# Prints a line a trial and a count; exit status 1 if anything is otherwise.
set -u
cavort=$1 problem=$2 kills=$3 interruptions=$4 seed=${5:-1}
[ $# -ge 5 ] && shift 5 || shift 4
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
failed=0 worst=0

now() { date +%s.%N; }
less() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a < b) }'; }

# what is the same in every solve: all of a verdict but how long it took and where it comes from
verdict() { grep -v '"solve_seconds"\|"provenance"' "$1/verdict.json"; }
same() {
  verdict "$1" >"$work/a"
  verdict "$work/whole" >"$work/b"
  cmp -s "$work/a" "$work/b" || return 1
  cmp -s "$1/trajectory.csv" "$work/whole/trajectory.csv" || return 1
  [ -e "$1/gains.csv" ] || [ -e "$work/whole/gains.csv" ] || return 0
  cmp -s "$1/gains.csv" "$work/whole/gains.csv"
}

wrong() {
  failed=$((failed + 1))
  echo "    WRONG: $*"
}

begin=$(now)
"$cavort" solve "$problem" -o "$work/whole" --quiet "$@" >/dev/null 2>&1
expected=$?
time=$(echo "$(now) $begin" | awk '{ print $1 - $2 }')
echo "$problem: left alone: exit status $expected"

i=0
while [ "$i" -lt $((kills + interruptions)) ]; do
  i=$((i + 1))
  out=$work/trial
  rm -rf "$out" "$out".*
  signal=KILL
  if [ "$i" -gt "$kills" ]; then
    case $((i % 3)) in 0) signal=INT ;; 1) signal=TERM ;; 2) signal=HUP ;; esac
  fi
  moment=$(awk -v seed="$seed" -v i="$i" -v time="$time" 'BEGIN { srand(1000 * seed + i); rand(); print rand() * time }')
  "$cavort" solve "$problem" -o "$out" --quiet "$@" >/dev/null 2>"$work/err" &
  child=$!
  sleep "$moment"
  asked=$(now)
  alive=1
  kill -s "$signal" "$child" 2>/dev/null || alive=0
  wait "$child" 2>/dev/null
  status=$?
  answer=$(echo "$(now) $asked" | awk '{ print $1 - $2 }')
  state=unfinished
  # it may have ended by itself while the signal was on its way
  if [ "$alive" = 0 ] || [ "$status" = "$expected" ]; then
    state=finished
  elif [ "$signal" != KILL ]; then
    [ "$status" = 130 ] || wrong "exit status $status, expected 130"
    less "$answer" "${CAVORT_ANSWER:-1}" || wrong "answered after $answer s"
    less "$answer" "$worst" || worst=$answer
    grep -q 'cavort: stopped' "$work/err" || wrong "nothing says that it was stopped"
  fi
  # nothing was written yet, or all can be read
  read=nothing
  if [ -e "$out/problem.xml" ]; then
    "$cavort" verify "$out" --quiet 2>"$work/err"
    read=$?
    [ "$read" = 0 ] || [ "$read" = 1 ] || wrong "verify: $(cat "$work/err")"
    "$cavort" view "$out" --quiet 2>"$work/err" || wrong "view: $(cat "$work/err")"
    "$cavort" explain "$out" >/dev/null 2>"$work/err"
    [ $? -le 1 ] || wrong "explain: $(cat "$work/err")"
  fi
  resume=
  [ -e "$out/checkpoint.csv" ] && resume=--resume
  "$cavort" solve "$problem" -o "$out" --quiet $resume "$@" >/dev/null 2>"$work/err"
  status=$?
  [ "$status" = "$expected" ] || wrong "going on: exit status $status, expected $expected: $(cat "$work/err")"
  same "$out" || wrong "another certificate or motion than that of the solve left alone"
  ls "$out" | grep -q '\.tmp$' && wrong "half a file is left"
  printf '%3d %-4s at %4.0f %% %s, verify %s, then %s\n' "$i" "$signal" \
    "$(echo "$moment $time" | awk '{ print 100 * $1 / $2 }')" "$state" "$read" "${resume:-anew}"
done
echo "$kills killed, $interruptions interrupted, $failed wrong"
echo "longest answer to an interruption $worst s"
[ "$failed" = 0 ]
