#!/usr/bin/env bash
# Every service of Fluxglobe as a process of its own on this machine, over real Kafka, PostGIS and S3, watched by Prometheus.
#   deploy/cluster.sh up       start the servers, then all services; send notices of sample files; say where to look
#   deploy/cluster.sh down     stop the services, then the servers; data stay
#   deploy/cluster.sh status   exit code 0 only when every service is ready
#   deploy/cluster.sh env      the settings that reach the cluster and the folder of the program, as `export` lines
#   deploy/cluster.sh targets  what Prometheus scrapes: SERVICE=HOST:PORT, with commas
# FLUXGLOBE_PROGRAM: the built program. FLUXGLOBE_RUN: folder of logs and data. FLUXGLOBE_LISTEN: the tile server's
# address, 127.0.0.1:8080 unless told otherwise. FLUXGLOBE_SAMPLES: folder of sample files; `none` sends nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=deploy/services/process.sh
source deploy/services/process.sh
program=${FLUXGLOBE_PROGRAM:-${CARGO_TARGET_DIR:-$HOME/.cache/fluxglobe/target}/debug/fluxglobe}
runs=${FLUXGLOBE_RUN:-$HOME/.cache/fluxglobe/run}
listen=${FLUXGLOBE_LISTEN:-127.0.0.1:8080}
# Files of your own that notices may name.
inbox=$runs/cluster/inbox
servers=(kafka postgis s3)
watcher=prometheus

# Service, its health address, and what it is told besides the common settings.
nodes=(
    'scheduler     127.0.0.1:18110 scheduler --scheduler-listen 127.0.0.1:18150'
    'executor-1    127.0.0.1:18111 executor --executor-listen 127.0.0.1:18151'
    'executor-2    127.0.0.1:18112 executor --executor-listen 127.0.0.1:18152'
    'render-1      127.0.0.1:18113 render-worker --render-listen 127.0.0.1:18161'
    'render-2      127.0.0.1:18114 render-worker --render-listen 127.0.0.1:18162'
    'ingestd-1     127.0.0.1:18115 ingestd'
    'ingestd-2     127.0.0.1:18116 ingestd'
    "tile-server   $listen         tile-server"
)

say() { printf 'cluster: %s\n' "$*" >&2; }

# Health and metrics of every process, under the name of its service.
targets() {
    local entry list=''
    for entry in "${nodes[@]}"; do
        read -r _name address service _words <<<"$entry"
        list+=${list:+,}$service=$address
    done
    printf '%s\n' "$list"
}

# What every service is told.
settings() {
    deploy/services/services.sh env "${servers[@]}"
    echo "export FLUXGLOBE_STORE=s3://fluxglobe/cluster"
    echo "export FLUXGLOBE_CLUSTER=http://127.0.0.1:18150"
    echo "export FLUXGLOBE_RENDER_WORKERS=127.0.0.1:18161,127.0.0.1:18162"
    echo "export FLUXGLOBE_ALLOW_FOLDER=$(samples_folder),$inbox"
    echo "export FLUXGLOBE_SPOOL=$runs/cluster/spool"
}

samples_folder() {
    local folder=${FLUXGLOBE_SAMPLES:-$HOME/.cache/fluxglobe/demo/files}
    if [ "$folder" = none ]; then folder=$runs/cluster; fi
    printf '%s\n' "$folder"
}

# Points the functions of process.sh at one of our services.
select_node() {
    name=$1
    run=$runs/cluster/$name
    pid_file=$run/pid
    log=$run/log
    mkdir -p "$run/data"
}

is_ready() { [ "$(curl -s -o /dev/null -m 3 -w '%{http_code}' "http://$1/readyz")" = 200 ]; }

start_node() {
    local name_of=$1 address=$2
    shift 2
    select_node "$name_of"
    if running_pid >/dev/null; then return; fi
    ! answers_tcp "${address##*:}" || fail "port ${address##*:} is taken by another program"
    # A name of its own that it keeps: a transaction that a kill left open is ended when it is back.
    export FLUXGLOBE_KAFKA_INSTANCE=$name_of
    if [ "$name_of" = tile-server ]; then
        launch "$program" "$@" --listen "$address"
    else
        FLUXGLOBE_EXECUTOR_WORK=$run/work launch "$program" "$@" --admin "$address"
    fi
}

up() {
    [ -x "$program" ] || fail "$program is not built; run: make build"
    deploy/services/services.sh install "${servers[@]}" "$watcher"
    FLUXGLOBE_PROMETHEUS_TARGETS=$(targets) deploy/services/services.sh start "${servers[@]}" "$watcher"
    mkdir -p "$runs/cluster/spool" "$inbox"
    if [ "${FLUXGLOBE_SAMPLES:-}" != none ]; then "$program" demo --fetch-only >/dev/null; fi
    local text
    text=$(settings)
    eval "$text"
    "$program" topics create
    local entry
    for entry in "${nodes[@]}"; do
        # shellcheck disable=SC2086 # words of the table
        start_node $entry
    done
    for entry in "${nodes[@]}"; do
        read -r name_of address _words <<<"$entry"
        select_node "$name_of"
        wait_until_ready is_ready "$address"
    done
    if [ "${FLUXGLOBE_SAMPLES:-}" != none ]; then
        "$program" notice "$(samples_folder)"/takahashi09/*.nc
    fi
    select_node cluster
    say "open http://$listen/"
    say "alerts: http://127.0.0.1:${FLUXGLOBE_PROMETHEUS_PORT:-19090}/alerts"
    say "files of your own: put them into $inbox and send notices of them"
    say "settings for commands of your own: eval \"\$(deploy/cluster.sh env)\""
    say "logs: $runs/cluster/*/log; stop with: make cluster-down"
}

down() {
    local index
    for ((index = ${#nodes[@]} - 1; index >= 0; index--)); do
        read -r name_of _rest <<<"${nodes[$index]}"
        select_node "$name_of"
        stop_with TERM
    done
    deploy/services/services.sh stop "${servers[@]}" "$watcher"
}

status() {
    local entry state=0
    for entry in "${nodes[@]}"; do
        read -r name_of address _words <<<"$entry"
        if is_ready "$address"; then
            printf '%-12s ready      http://%s/\n' "$name_of" "$address"
        else
            printf '%-12s not ready  http://%s/readyz\n' "$name_of" "$address"
            state=1
        fi
    done
    return $state
}

case ${1:-} in
up) up ;;
down) down ;;
status) status ;;
env)
    settings
    echo "export PATH=$(realpath --canonicalize-missing "$(dirname "$program")"):\$PATH"
    ;;
targets) targets ;;
*)
    sed -n '2,9s/^# \?//p' "${BASH_SOURCE[0]}" >&2
    exit 2
    ;;
esac
