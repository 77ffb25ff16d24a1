#!/usr/bin/env bash
# Prints the tests that ended without having run, from the file that FLUXGLOBE_SKIPPED named; fails if there are more of
# them than the list allows. What was not tested because NO_GPU=1 said so is told apart, and is no failure.
#   tests/data/report.sh FILE
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
listed=$(grep -cvE '^\s*(#|$)' "$here/may-not-run.txt")
off='NO_GPU=1: '
names=''
switched_off=''
if [ -s "$1" ]; then
    names=$(sort -u "$1" | sed "/^$off/d")
    switched_off=$(sort -u "$1" | sed -n "s/^$off//p")
fi

# count LINES: how many there are.
count() { if [ -n "$1" ]; then wc -l <<<"$1"; else echo 0; fi; }

not_run=$(count "$names")
if [ -n "$names" ]; then
    echo "tests that did not run here, and may not (tests/data/may-not-run.txt says what each lacks):"
    printf '%s\n' "$names" | sed 's/^/    /'
fi
if [ -n "$switched_off" ]; then
    echo "$(count "$switched_off") things were not tested for want of a graphics device, since NO_GPU=1 says so:"
    printf '%s\n' "$switched_off" | sed 's/^/    /'
fi
echo "$not_run of at most $listed listed tests did not run"
[ "$not_run" -le "$listed" ]
