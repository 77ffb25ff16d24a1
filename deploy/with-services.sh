#!/usr/bin/env bash
# Runs a command with servers of its own (Kafka, PostGIS, S3, HDFS): started before on free ports in a new folder, stopped
# and removed after, whatever became of the command. Its exit code is the command's.
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
stop() {
    "$here/services/services.sh" stop "${names[@]}" >/dev/null 2>&1 || true
    rm -rf "$FLUXGLOBE_RUN"
}
trap stop EXIT
"$here/services/services.sh" start "${names[@]}"
settings=$("$here/services/services.sh" env "${names[@]}")
eval "$settings"
# Servers that the command starts for itself find ports and folders of their own.
env -u FLUXGLOBE_KAFKA_PORT -u FLUXGLOBE_KAFKA_CONTROLLER_PORT -u FLUXGLOBE_POSTGIS_PORT -u FLUXGLOBE_S3_PORT \
    -u FLUXGLOBE_HDFS_PORT -u FLUXGLOBE_HDFS_HTTP_PORT "$@"
