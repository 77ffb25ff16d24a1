#!/usr/bin/env bash
# One Prometheus server on 127.0.0.1, its program taken out of Debian's package, so that no system service comes with it.
#   deploy/services/prometheus.sh install | start | stop | status | env
# FLUXGLOBE_PROMETHEUS_PORT (19090)
# FLUXGLOBE_PROMETHEUS_TARGETS: comma-separated SERVICE=HOST:PORT to scrape (the processes of deploy/cluster.sh)
# FLUXGLOBE_PROMETHEUS_RULES: a rule file, or a pattern of several (deploy/prometheus/rules.yml)
# FLUXGLOBE_PROMETHEUS_INTERVAL_S: seconds between two scrapes (5)
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=debian.sh
source "$here/debian.sh"

port=${FLUXGLOBE_PROMETHEUS_PORT:-19090}
check_port FLUXGLOBE_PROMETHEUS_PORT "$port"
targets=${FLUXGLOBE_PROMETHEUS_TARGETS-}
rules=${FLUXGLOBE_PROMETHEUS_RULES-$here/../prometheus/rules.yml}
interval_s=${FLUXGLOBE_PROMETHEUS_INTERVAL_S:-5}

install_service() {
    command -v curl >/dev/null || need_package curl /usr/bin/curl
    if ! [ -x "$service/package/usr/bin/prometheus" ]; then
        say 'fetching the Debian package prometheus'
        unpack_package prometheus "$service/package"
    fi
    mkdir -p "$service/bin"
    ln -sf ../package/usr/bin/prometheus ../package/usr/bin/promtool "$service/bin/"
    "$service/bin/prometheus" --version 2>&1 | head -n 1 >"$service/installed"
    say "installed: $(cat "$service/installed")"
}

# The rules know every target by its job and the label of its service.
write_settings() {
    local target list=''
    [[ $interval_s =~ ^[1-9][0-9]{0,3}$ ]] || fail "FLUXGLOBE_PROMETHEUS_INTERVAL_S is no number of seconds: $interval_s"
    IFS=, read -ra wanted <<<"${targets:-$("$here/../cluster.sh" targets)}"
    for target in "${wanted[@]}"; do
        [[ $target =~ ^([a-z][a-z-]*)=([][A-Za-z0-9.:_-]+:[0-9]{1,5})$ ]] ||
            fail "FLUXGLOBE_PROMETHEUS_TARGETS names no SERVICE=HOST:PORT: $target"
        list+="      - {targets: [\"${BASH_REMATCH[2]}\"], labels: {service: ${BASH_REMATCH[1]}}}"$'\n'
    done
    [[ $rules != *[\"\\]* ]] || fail 'FLUXGLOBE_PROMETHEUS_RULES holds a quotation mark or a backslash'
    {
        printf '# Written at every start from the settings of this run.\n'
        printf 'global:\n  scrape_interval: %ss\n  scrape_timeout: %ss\n  evaluation_interval: %ss\n' \
            "$interval_s" "$interval_s" "$interval_s"
        if [ -n "$rules" ]; then printf 'rule_files: ["%s"]\n' "$(readlink -m "$(dirname "$rules")")/$(basename "$rules")"; fi
        printf 'scrape_configs:\n  - job_name: fluxglobe\n    static_configs:\n%s' "$list"
    } >"$run/prometheus.yml"
}

launch_server() {
    write_settings
    "$service/bin/promtool" check config "$run/prometheus.yml" >>"$log" 2>&1 || {
        tail -n 10 "$log" >&2
        fail 'its settings are wrong'
    }
    launch "$service/bin/prometheus" "--config.file=$run/prometheus.yml" "--storage.tsdb.path=$run/data" \
        --storage.tsdb.retention.time=2d "--web.listen-address=127.0.0.1:$port"
}

server_answers() { curl --silent --fail --max-time 3 "http://127.0.0.1:$port/-/ready"; }

start_service() { start_once launch_server server_answers "$port"; }
stop_service() { stop_with TERM; }
status_service() { status_line "127.0.0.1:$port"; }
env_service() { printf 'export FLUXGLOBE_PROMETHEUS=http://127.0.0.1:%s\n' "$port"; }

main "$@"
