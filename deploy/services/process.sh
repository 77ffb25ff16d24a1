# shellcheck shell=bash
# Starts, watches and ends one server process: in goes its run folder and command, out comes a pid file, a log file and
# a server that answers. Sourced by the file of every service, after which it is named.
set -euo pipefail

# The folder of these files, for those that source this one.
export here
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
services=${FLUXGLOBE_SERVICES:-$HOME/.cache/fluxglobe/services}
# `service`: what was installed; `run`: what one instance writes. A test gives an instance of its own another `run`.
name=$(basename "$0" .sh)
service=$services/$name
run=${FLUXGLOBE_RUN:-$HOME/.cache/fluxglobe/run}/$name
pid_file=$run/pid
log=$run/log
# Every server inherits its data folder opened as this descriptor.
data_fd=8
# How long a server may take until it answers, and until it has stopped by itself.
start_limit_s=${FLUXGLOBE_START_LIMIT_S:-180}
stop_limit_s=${FLUXGLOBE_STOP_LIMIT_S:-30}
# An older log is set aside once, at a start, when it is larger than this.
log_limit_bytes=$((16 << 20))

say() { printf '%s: %s\n' "$name" "$*" >&2; }

fail() {
    say "$*"
    exit 1
}

# A port is a number; anything else would end in a configuration file.
check_port() {
    if ! [[ $2 =~ ^[1-9][0-9]{0,4}$ ]] || (($2 > 65535)); then fail "$1 is no port number: $2"; fi
}

answers_tcp() { (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null; }

# Prints the pid of our running server. The pid file alone is no proof: after kill -9 the number may belong to somebody
# else, so the process must also hold our data folder open under the number that launch gave it.
running_pid() {
    local pid
    pid=$(cat "$pid_file" 2>/dev/null) || return 1
    [[ $pid =~ ^[0-9]+$ ]] || return 1
    [ "$(readlink "/proc/$pid/fd/$data_fd" 2>/dev/null)" = "$(readlink -f "$run/data")" ] || return 1
    printf '%s\n' "$pid"
}

# Two callers must not install or start the same thing at once: the second one waits, then finds it done.
with_lock() {
    local folder=$1
    shift
    mkdir -p "$folder"
    exec 9>"$folder/.lock"
    flock 9
    "$@"
    flock -u 9
    exec 9>&-
}

need_installed() { [ -e "$service/installed" ] || fail "not installed; run: deploy/services/services.sh install $name"; }

# launch COMMAND...: runs it with its data folder open, detached from this terminal, and writes its pid.
launch() {
    local old_bytes
    old_bytes=$(stat -c %s "$log" 2>/dev/null || echo 0)
    if ((old_bytes > log_limit_bytes)); then mv -f "$log" "$log.1"; fi
    (
        cd /
        exec 8<"$run/data" 9>&-
        # A background child leads no process group, so setsid becomes the command itself and the pid stays.
        setsid "$@" </dev/null >>"$log" 2>&1 &
        echo $! >"$pid_file"
    )
}

# answers_in_time CHECK...: 0 when the check succeeds, 1 when the server ended meanwhile, 2 when it took too long.
answers_in_time() {
    local since=$EPOCHREALTIME until=$((SECONDS + start_limit_s))
    until "$@" >/dev/null 2>&1; do
        running_pid >/dev/null || return 1
        ((SECONDS < until)) || return 2
        sleep 0.2
    done
    say "ready after $(awk -v a="$since" -v b="$EPOCHREALTIME" 'BEGIN { printf "%.1f", b - a }') s"
}

# wait_until_ready CHECK...: ends with the tail of the log when the server died or is late.
wait_until_ready() {
    local outcome=0
    answers_in_time "$@" || outcome=$?
    if [ $outcome = 0 ]; then return; fi
    tail -n 30 "$log" >&2
    if [ $outcome = 1 ]; then fail "ended while starting; its log: $log"; fi
    fail "does not answer after $start_limit_s s; its log: $log"
}

# A killed server may need a moment to let go of its port.
need_free_port() {
    local until=$((SECONDS + 5))
    while answers_tcp "$1"; do
        ((SECONDS < until)) || fail "port $1 is taken by another program; choose another one (see README.md)"
        sleep 0.2
    done
}

# start_once LAUNCHER CHECK PORT...: nothing to do when it runs and answers, otherwise starts it on free ports.
start_once() {
    local launcher=$1 check=$2 wanted_port
    shift 2
    need_installed
    mkdir -p "$run/data"
    # One that was just killed may still look alive, hence the second look after waiting for its answer.
    if running_pid >/dev/null && answers_in_time "$check"; then return; fi
    if running_pid >/dev/null; then fail "runs, but does not answer within $start_limit_s s; its log: $log"; fi
    rm -f "$pid_file"
    for wanted_port in "$@"; do need_free_port "$wanted_port"; done
    "$launcher"
    wait_until_ready "$check"
}

# stop_with SIGNAL: sends it, waits, and kills what is still there.
stop_with() {
    local pid until=$((SECONDS + stop_limit_s))
    if pid=$(running_pid); then
        kill "-$1" "$pid" 2>/dev/null || true
        while running_pid >/dev/null; do
            if ((SECONDS >= until)); then
                say "did not stop within $stop_limit_s s: killed"
                kill -KILL "$pid" 2>/dev/null || true
            fi
            sleep 0.1
        done
        say 'stopped'
    fi
    rm -f "$pid_file"
}

# One line: state, pid, resident memory.
status_line() {
    local pid
    if ! [ -e "$service/installed" ]; then
        printf '%-11s not installed\n' "$name"
    elif pid=$(running_pid); then
        printf '%-11s running  pid %-8s %5d MiB  %s\n' "$name" "$pid" \
            "$(awk '/^VmRSS/ { print int($2 / 1024) }' "/proc/$pid/status")" "$*"
    else
        printf '%-11s stopped\n' "$name"
        return 3
    fi
}

# main VERB: what every service file ends with; it defines the five functions below.
main() {
    umask 022
    case ${1:-} in
    install) with_lock "$service" install_service ;;
    start) with_lock "$run" start_service ;;
    stop) if [ -d "$run" ]; then with_lock "$run" stop_service; fi ;;
    status) status_service ;;
    env) env_service ;;
    *) fail 'usage: install | start | stop | status | env' ;;
    esac
}
