#!/usr/bin/env bash
# Hadoop's own command-line client for files, from the jars that services.sh installs.
#   deploy/services/hdfs-tool.sh -mkdir -p /fluxglobe
#   deploy/services/hdfs-tool.sh -put grid.nc /fluxglobe/grid.nc
#   deploy/services/hdfs-tool.sh -ls -R /
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=java.sh
source "$here/java.sh"

jars=${FLUXGLOBE_SERVICES:-$HOME/.cache/fluxglobe/services}/hdfs/lib
[ -d "$jars" ] || {
    echo 'hdfs-tool: not installed; run: deploy/services/services.sh install hdfs' >&2
    exit 1
}
java=$(find_java) || {
    echo 'no Java 17' >&2
    exit 1
}
exec "$java" -Xmx256m "${small_java[@]}" -Dfluxglobe.log=WARN \
    "-Dlog4j.configuration=file:$here/hdfs/log4j.properties" \
    "-Dfluxglobe.hdfs=${FLUXGLOBE_HDFS:-hdfs://127.0.0.1:${FLUXGLOBE_HDFS_PORT:-18020}}" \
    -cp "$here/hdfs:$jars/*" org.apache.hadoop.fs.FsShell "$@"
