#!/usr/bin/env bash
# Runs a command with servers of its own (Kafka, PostGIS, S3, HDFS): started before on free ports in a new folder, stopped
# and removed after, whatever became of the command, and also when this is killed. Its exit code is the command's.
#   deploy/with-services.sh COMMAND [ARGUMENT...]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
[ $# -gt 0 ] || {
    sed -n '2,4s/^# \?//p' "${BASH_SOURCE[0]}" >&2
    exit 2
}
names=(kafka postgis s3 hdfs)

free_ports() {
    python3 - "$1" <<'END'
import socket, sys
sockets = [socket.socket() for _ in range(int(sys.argv[1]))]
for s in sockets:
    s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in sockets))
END
}

FLUXGLOBE_RUN=$(mktemp -d "${TMPDIR:-/tmp}/fluxglobe-services.XXXXXX")
export FLUXGLOBE_RUN
# Servers that are started as another user must be able to pass through.
chmod 755 "$FLUXGLOBE_RUN"
read -r FLUXGLOBE_KAFKA_PORT FLUXGLOBE_KAFKA_CONTROLLER_PORT FLUXGLOBE_POSTGIS_PORT FLUXGLOBE_S3_PORT FLUXGLOBE_HDFS_PORT \
    FLUXGLOBE_HDFS_HTTP_PORT <<<"$(free_ports 6)"
export FLUXGLOBE_KAFKA_PORT FLUXGLOBE_KAFKA_CONTROLLER_PORT FLUXGLOBE_POSTGIS_PORT FLUXGLOBE_S3_PORT FLUXGLOBE_HDFS_PORT \
    FLUXGLOBE_HDFS_HTTP_PORT
# Servers lead sessions of their own. So does what stops them, which nothing that is sent to this group ends: its input comes to
# its end with this process, whatever ends that, since nobody else is given the descriptor.
# shellcheck disable=SC2016 # the inner shell's own
exec 7> >(exec setsid sh -c 'cat; "$0" stop "$@"; rm -rf "$FLUXGLOBE_RUN"' "$here/services/services.sh" "${names[@]}" >/dev/null 2>&1)
watcher=$!
stop() {
    exec 7>&-
    # Not `wait`: after some signals the shell knows it no longer.
    while [ -d "$FLUXGLOBE_RUN" ] && kill -0 "$watcher" 2>/dev/null; do sleep 0.1; done
}
trap stop EXIT
"$here/services/services.sh" start "${names[@]}" 7>&-
settings=$("$here/services/services.sh" env "${names[@]}")
eval "$settings"
# Servers that the command starts for itself find ports and folders of their own.
env -u FLUXGLOBE_KAFKA_PORT -u FLUXGLOBE_KAFKA_CONTROLLER_PORT -u FLUXGLOBE_POSTGIS_PORT -u FLUXGLOBE_S3_PORT \
    -u FLUXGLOBE_HDFS_PORT -u FLUXGLOBE_HDFS_HTTP_PORT "$@" 7>&-
