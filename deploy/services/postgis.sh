#!/usr/bin/env bash
# One PostgreSQL 15 server with PostGIS on 127.0.0.1, its programs from Debian, its database in our own folder.
#   deploy/services/postgis.sh install | start | stop | status | env
# FLUXGLOBE_POSTGIS_PORT (15432). User and database are both called fluxglobe; the password is made at the first start and
# lies in the file `password` of the run folder. FLUXGLOBE_POSTGIS_TLS=true: clients over TLS and no others; the certificate
# is made at the first start with it and lies in the file `certificate.pem`.
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=debian.sh
source "$here/debian.sh"
# shellcheck source=certificate.sh
source "$here/certificate.sh"

port=${FLUXGLOBE_POSTGIS_PORT:-15432}
check_port FLUXGLOBE_POSTGIS_PORT "$port"
programs=/usr/lib/postgresql/15/bin
password_file=$run/password
tls=${FLUXGLOBE_POSTGIS_TLS:-false}
[[ $tls = true || $tls = false ]] || fail "FLUXGLOBE_POSTGIS_TLS is true or false, not: $tls"

install_service() {
    # Debian makes and starts a cluster on port 5432 when the server is installed; not on behalf of ours.
    local no_cluster=/etc/postgresql-common/createcluster.d/fluxglobe.conf
    if ! [ -x "$programs/postgres" ]; then
        need_package postgresql-common /usr/bin/pg_createcluster
        as_root sh -c "mkdir -p '${no_cluster%/*}' && echo 'create_main_cluster = false' >'$no_cluster'"
        need_package postgresql-15 "$programs/postgres"
        as_root rm -f "$no_cluster"
    fi
    need_package openssl /usr/bin/openssl
    need_package postgresql-15-postgis-3 '/usr/share/postgresql/15/extension/postgis.control'
    "$programs/postgres" --version >"$service/installed"
    say "installed: $(cat "$service/installed")"
}

# PostgreSQL refuses to run as root: then it runs as Debian's user for it. That user may not be able to walk down to our
# folder (a private home, a test's temporary folder), so its programs get the folder opened and know it by descriptor.
data=/proc/self/fd/$data_fd

as_owner() {
    if [ "$(id -u)" = 0 ]; then
        local launcher=()
        if [ "$1" = launch ]; then
            launcher=(launch)
            shift
        fi
        "${launcher[@]}" setpriv --reuid postgres --regid postgres --clear-groups "$@"
    else
        "$@"
    fi
}

make_cluster() {
    say 'making its database'
    if ! [ -s "$password_file" ]; then
        (umask 077 && head -c 24 /dev/urandom | base64 | tr '+/' '-_' >"$password_file")
    fi
    chmod 755 "$run"
    chmod 700 "$run/data"
    # An interrupted first start leaves half a cluster behind, which initdb refuses.
    find "$run/data" -mindepth 1 -delete
    if [ "$(id -u)" = 0 ]; then chown postgres "$run" "$run/data" "$password_file"; fi
    (
        cd /
        exec 8<"$run/data" 9>&-
        as_owner "$programs/initdb" --pgdata="$data" --username=fluxglobe --pwfile="$data/../password" \
            --auth=scram-sha-256 --encoding=UTF8 --locale=C.UTF-8 --no-instructions
    ) >>"$log" 2>&1 || {
        tail -n 30 "$log" >&2
        fail "could not make its database; its log: $log"
    }
    : >"$run/made"
}

# After kill -9 the lock file names a process that may linger as a zombie, for which the server would wait for ever. It is
# stale once no process works in the data folder any more: then, and only then, it goes.
clear_stale_lock() {
    local until=$((SECONDS + stop_limit_s)) folder
    folder=$(readlink -f "$run/data")
    while [ -n "$(find /proc -maxdepth 2 -path '/proc/[0-9]*/cwd' -lname "$folder" -print -quit 2>/dev/null)" ]; do
        ((SECONDS < until)) || fail "processes of a killed server still work in $folder"
        sleep 0.1
    done
    rm -f "$run/data/postmaster.pid"
}

# The server reads key and certificate under these names, and turns away whoever speaks no TLS.
secure() {
    if ! [ -s "$run/certificate.pem" ]; then
        make_certificate "$run/data/server.key" "$run/data/server.crt"
        if [ "$(id -u)" = 0 ]; then chown postgres "$run/data/server.key" "$run/data/server.crt"; fi
        sed 's/^host /hostssl /' "$run/data/pg_hba.conf" >"$run/pg_hba.new"
        cat "$run/pg_hba.new" >"$run/data/pg_hba.conf"
        rm "$run/pg_hba.new"
        cp "$run/data/server.crt" "$run/certificate.pem"
    fi
}

# Loopback only, no Unix socket; small buffers, since several servers share one machine.
launch_server() {
    if ! [ -e "$run/made" ]; then make_cluster; fi
    if [ "$tls" = true ]; then secure; fi
    clear_stale_lock
    as_owner launch env -u PGDATA LC_ALL=C.UTF-8 "$programs/postgres" -D "$data" -p "$port" -c listen_addresses=127.0.0.1 \
        -c unix_socket_directories= -c shared_buffers=64MB -c max_connections=100 -c password_encryption=scram-sha-256 \
        -c jit=off -c "ssl=$tls" -c log_line_prefix='%m [%p] '
}

query() {
    PGPASSWORD=$(cat "$password_file") PGCONNECT_TIMEOUT=3 \
        "$programs/psql" -X -q -A -t -v ON_ERROR_STOP=1 -h 127.0.0.1 -p "$port" -U fluxglobe "$@"
}

server_answers() { query -d postgres -c 'SELECT 1'; }

start_service() {
    start_once launch_server server_answers "$port"
    if [ "$(query -d postgres -c "SELECT count(*) FROM pg_database WHERE datname = 'fluxglobe'")" = 0 ]; then
        query -d postgres -c 'CREATE DATABASE fluxglobe'
    fi
    query -d fluxglobe -c "SET client_min_messages = warning; CREATE EXTENSION IF NOT EXISTS postgis"
}

# The interrupt asks for a fast stop: sessions are ended, the data are written.
stop_service() { stop_with INT; }
status_service() { status_line "127.0.0.1:$port"; }
env_service() {
    local mode=''
    if [ "$tls" = true ]; then
        mode='?sslmode=verify-full'
        printf 'export FLUXGLOBE_POSTGIS_CA_FILE=%q\n' "$run/certificate.pem"
    fi
    printf "export FLUXGLOBE_POSTGIS='%s'\n" "postgres://fluxglobe@127.0.0.1:$port/fluxglobe$mode"
    printf 'export FLUXGLOBE_POSTGIS_PASSWORD_FILE=%q\n' "$password_file"
}

main "$@"
