#!/bin/sh
# A batch in which things go wrong: N problems, and among them one whose process is killed, a broken file, one whose folder is
# on a full disk (where a small file system can be mounted), one whose files may not grow so large. The others finish, the
# table tells; the same command again solves those alone. Then a batch that is interrupted, and a sweep.
# Usage: batch.sh CAVORT SOURCE_ROOT [N [J]]   by hand 200, among the tests fewer
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$(cd "$2" && pwd)
n=${3:-200}
jobs=${4:-2}
# a file system of its own for this script alone, where that is allowed
if [ -z "${CAVORT_UNSHARED:-}" ]; then
  for how in "unshare -m" "unshare -rm"; do
    if CAVORT_UNSHARED=1 $how sh -c 'd=$(mktemp -d) && mount -t tmpfs -o size=16k none "$d"' 2>/dev/null; then
      CAVORT_UNSHARED=yes exec $how sh "$0" "$cavort" "$root" "$n" "$jobs"
    fi
  done
fi
work=$(mktemp -d)
leave() { umount "$work/small" 2>/dev/null; rm -rf "$work"; }
trap leave EXIT
cd "$work" || exit 1
failed=0
check() { text=$1; shift; "$@" || { failed=$((failed + 1)); echo "failed: $text"; return 1; }; }
# pages are not what this is about
export CAVORT_THREE_JS=/nowhere

cp "$root/tests/batch_model.xml" "$root/tests/rise_model.xml" .
i=1
while [ $i -le "$n" ]; do
  sed "s/pos=\"0.5\"/pos=\"0.$((100 + i))\"/" "$root/tests/batch.xml" >"p$(printf %03d $i).xml"
  i=$((i + 1))
done
# of these problems go wrong: in vain for a while, which is killed; cut off in the middle; finer, so that files are large
sed 's/timestep=".025"/timestep=".008"/' "$root/tests/rise.xml" >p002.xml
head -c 200 "$root/tests/batch.xml" >p003.xml
sed 's/timestep="0.05"/timestep="0.0002"/' "$root/tests/batch.xml" >p004.xml
wrong=3
mkdir batch small
if [ "${CAVORT_UNSHARED:-}" = yes ] && mount -t tmpfs -o size=16k none small; then
  ln -s ../small batch/p005
  wrong=4
else
  echo "left out: a full disk (no file system can be mounted here)"
fi
# ten times what the others need, less than p004.xml does
limited() { (ulimit -f 200; exec "$@"); }

# kills the process that writes p002.log; its parent goes on. One look at all processes is one command: a fork each is too
# slow on a machine with many
kill_one() {
  tries=0
  while [ $tries -lt 600 ]; do
    if [ -s batch/p002/checkpoint.csv ]; then
      process=$(find /proc/[0-9]*/fd/1 -maxdepth 0 -lname "$work/batch/p002.log" 2>/dev/null | head -n 1)
      process=${process#/proc/}
      [ -n "$process" ] && kill -9 "${process%%/*}" && return 0
    fi
    sleep 0.05
    tries=$((tries + 1))
  done
  return 1
}

start=$(date +%s)
limited "$cavort" solve p*.xml -j "$jobs" -o batch >out 2>err &
batch=$!
kill_one
check "a process is killed" [ $? -eq 0 ]
wait $batch
check "exit status 1" [ $? -eq 1 ]
echo "$n problems, $jobs at a time: $(($(date +%s) - start)) s"
"$cavort" table batch --csv >table.csv
check "a line a problem" [ "$(wc -l <table.csv)" -eq $((n + 1)) ]
check "all others are certified and achieve" [ "$(grep -c ',batch,swing,1,1,.*,$' table.csv)" -eq $((n - wrong)) ]
row() { check "the table says of $1: $2" grep -q "^$1,.*$2" table.csv; }
row p002 "ended by signal 9 (Killed)"
row p003 "p003.xml:[0-9]*: "
row p004 "cannot be written: File too large"
[ $wrong -eq 4 ] && row p005 "cannot be written: No space left on device"
grep -E '^p00[2345],' table.csv
check "the same is printed at the end" [ "$(grep -c '^p' out)" -eq "$n" ]
check "and counted" grep -q "^$((n - wrong)) of $n certified, $((n - wrong)) of these" out
# what kill -9 leaves behind aside
check "no half files" [ -z "$(find batch small -name '*.tmp*' | grep -v p002)" ]

# the same command again: what came to its end stands, the others are solved, the killed one from where it was
umount small 2>/dev/null
cp "$root/tests/batch.xml" p003.xml
ls -i batch/*/verdict.json | sort >before
"$cavort" solve p*.xml -j "$jobs" -o batch >out 2>err
check "all are well: exit status 0" [ $? -eq 0 ]
check "these alone are solved" [ "$(grep -c '^ *[0-9]* of' err)" -eq $wrong ] || cat err
ls -i batch/*/verdict.json | sort >after
check "results stand" [ "$(comm -12 before after | wc -l)" -eq $((n - wrong)) ]
"$cavort" solve p002.xml --threads 1 -o alone -q 2>/dev/null
check "the killed one ends as if nothing had been" cmp -s alone/trajectory.csv batch/p002/trajectory.csv
# a changed problem and a changed option are solved anew
sed -i 's/pos="0.[0-9]*"/pos="0.4"/' p001.xml
"$cavort" solve p001.xml p006.xml -j 2 -o batch >out 2>err
check "a changed problem is solved anew, others are not" [ "$(grep -c '^ *[0-9]* of' err)" -eq 1 ]
"$cavort" solve p001.xml p006.xml -j 2 --strategies 1 -o batch >out 2>err
check "with other options all are" [ "$(grep -c '^ *[0-9]* of' err)" -eq 2 ]

# interrupted in the middle, and gone on with
"$cavort" solve p*.xml -j "$jobs" -o stopped >out 2>err &
batch=$!
while [ "$(ls stopped/*.record 2>/dev/null | wc -l)" -lt 4 ]; do sleep 0.05; done
kill -TERM $batch
wait $batch
check "interrupted: exit status 130" [ $? -eq 130 ]
check "says how to go on" grep -q "the same command goes on" err
first=$(grep -c '^ *[0-9]* of' err)
"$cavort" solve p*.xml -j "$jobs" -o stopped >out 2>err
check "gone on: exit status 0" [ $? -eq 0 ]
second=$(grep -c '^ *[0-9]* of' err)
check "no problem that had ended is solved twice ($first, then $second)" [ $((first + second)) -le $((n + jobs)) ]
for p in p001 p002 p007; do
  check "$p has the same bits" cmp -s "stopped/$p/trajectory.csv" "batch/$p/trajectory.csv"
done

# nohup: a terminal that closes ends nothing
(trap '' HUP; exec "$cavort" solve p002.xml p007.xml -j 2 -o kept -q) &
batch=$!
until [ -s kept/p002/checkpoint.csv ]; do sleep 0.05; done
kill -HUP $batch
for process in $(find /proc/[0-9]*/fd/1 -maxdepth 0 -lname "$work/kept/p002.log" 2>/dev/null); do
  process=${process#/proc/}
  kill -HUP "${process%%/*}"
done
wait $batch
check "nohup: all are solved" [ $? -eq 0 ]

# values of settings
"$cavort" solve p001.xml --set goal/pivot/@pos=0.2,0.3 --set cost/there/@weight=400 --set limits/@effort=0.5,0.7 -o sweep >out 2>err
check "a sweep of four" [ $? -eq 0 ]
check "its names" [ "$(ls -d sweep/*.record | tr '\n' ' ')" = "sweep/p001,pivot.pos=0.2,limits.effort=0.5.record \
sweep/p001,pivot.pos=0.2,limits.effort=0.7.record sweep/p001,pivot.pos=0.3,limits.effort=0.5.record \
sweep/p001,pivot.pos=0.3,limits.effort=0.7.record " ]
check "its values" grep -q '<limits effort="0.7"/></problem>' "sweep/p001,pivot.pos=0.3,limits.effort=0.7.xml"
grep -q 'pos="0.3"' "sweep/p001,pivot.pos=0.3,limits.effort=0.7.xml" || failed=$((failed + 1))
"$cavort" solve p001.xml --set goal/pivot/@pos=0.2 --set cost/there/@weight=400 --set limits/@effort=0.5 -o one -q 2>err
check "one value: the same" cmp -s one/trajectory.csv "sweep/p001,pivot.pos=0.2,limits.effort=0.5/trajectory.csv"
# told: a path that is not there, in one and in a batch
"$cavort" solve p001.xml --set cost/their/@weight=1 -q 2>err
check "a wrong path: exit status 2" [ $? -eq 2 ]
check "says what there is" grep -q "has no 'their'; did you mean 'there'?; it has or may have: there, posture, effort" err
"$cavort" solve p001.xml p006.xml --set cost/there/@wieght=1 -o none >out 2>err
check "a wrong attribute: exit status 1" [ $? -eq 1 ]
check "says it of each" [ "$(grep -c "did you mean 'weight'" err)" -eq 2 ]
check "and in the table" grep -q "did you mean 'weight'" out
mkdir empty
"$cavort" table empty 2>err
check "no results: exit status 2" [ $? -eq 2 ]
"$cavort" table batch/p001 >out
check "the table of a result" grep -q "^batch/p001 *batch *swing *yes *yes" out
[ "$failed" -eq 0 ] && echo "batch: all as wanted"
exit "$failed"
