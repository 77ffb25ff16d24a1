#!/usr/bin/env bash
# Prints the tests that ended without having run, from the file that FLUXGLOBE_SKIPPED named; fails if there are more of
# them than the list allows.
#   tests/data/report.sh FILE
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
listed=$(grep -cvE '^\s*(#|$)' "$here/may-not-run.txt")
not_run=0
if [ -s "$1" ]; then
    names=$(sort -u "$1")
    not_run=$(wc -l <<<"$names")
    echo "tests that did not run here, and may not (tests/data/may-not-run.txt says what each lacks):"
    sed 's/^/    /' <<<"$names"
fi
echo "$not_run of at most $listed listed tests did not run"
[ "$not_run" -le "$listed" ]
