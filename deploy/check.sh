#!/usr/bin/env bash
# Checks everything in deploy/ and the gallery's page, each kind of file with its own tool, and sees each check fail on a planted fault.
#   deploy/check.sh            everything
#   deploy/check.sh NAME...    shell, node, image, compose, prometheus, grafana, chart, unit, gallery
# The tools are installed by check/install.sh and, for promtool, services/prometheus.sh.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")"
tools=${FLUXGLOBE_TOOLS:-$HOME/.cache/fluxglobe/tools}
promtool=${FLUXGLOBE_SERVICES:-$HOME/.cache/fluxglobe/services}/prometheus/bin/promtool
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

ran=0
# checked NAME COMMAND...: runs a check quietly and shows what it said if it fails.
checked() {
    local name=$1
    shift
    if ! "$@" >"$work/said" 2>&1; then
        cat "$work/said" >&2
        printf 'deploy: FAILED: %s\n' "$name" >&2
        exit 1
    fi
    ran=$((ran + 1))
    printf 'deploy: ok: %s\n' "$name"
}

# refused NAME TEXT COMMAND...: the check must fail on a planted fault, and say TEXT about it.
refused() {
    local name=$1 text=$2
    shift 2
    if "$@" >"$work/said" 2>&1 || ! grep --quiet --fixed-strings -- "$text" "$work/said"; then
        cat "$work/said" >&2
        printf 'deploy: FAILED: no complaint about "%s" from: %s\n' "$text" "$name" >&2
        exit 1
    fi
    ran=$((ran + 1))
    printf 'deploy: ok: %s sees a planted fault\n' "$name"
}

check_shell() {
    if ! [ -x "$tools/bin/shellcheck" ]; then
        printf 'deploy: shell: shellcheck has no wheel for this machine, left out\n'
        return
    fi
    local scripts
    mapfile -t scripts < <(git ls-files '*.sh' | sed 's|^|./|')
    checked "shellcheck of ${#scripts[@]} scripts" "$tools/bin/shellcheck" --external-sources --source-path=SCRIPTDIR --source-path=.. "${scripts[@]}"
    checked 'cluster.sh env leads to the program' leads_to_program
    refused 'the look for the program' 'is not found' leads_to_program 'export PATH='
    printf '%s\n' '#!/bin/bash' "rm -r \$1" >"$work/fault.sh"
    refused shellcheck SC2086 "$tools/bin/shellcheck" "$work/fault.sh"
}

# leads_to_program [WITHOUT]: is the program found after `eval` of the settings, of which lines with a text are left out?
leads_to_program() {
    local found
    mkdir -p "$work/built"
    install -m 755 /dev/null "$work/built/fluxglobe"
    # FLUXGLOBE_RUN: nothing of a cluster that runs is looked at.
    found=$(FLUXGLOBE_PROGRAM=$work/built/fluxglobe FLUXGLOBE_RUN=$work ./cluster.sh env | grep --invert-match "${1:-no text}")
    # In a shell that has nothing but the system's programs.
    found=$(PATH=/usr/bin:/bin && eval "$found" && command -v fluxglobe || true)
    [ "$found" = "$work/built/fluxglobe" ] || { echo 'the program is not found' && return 1; }
}

check_node() {
    local version
    for version in v18.17.0 v20.20.2 v22.0.0 v25.1.0; do checked "Node $version builds the viewer" ./check-node.sh "$version"; done
    for version in v16.20.1 v18.16.1 v21.3.0 nonsense; do refused 'the look at Node' 'install Node 22' ./check-node.sh "$version"; done
}

holds_release() { grep --quiet 'cargo build --locked --release' "$1" || { echo 'no release build' && return 1; }; }

check_image() {
    checked 'hadolint of the Dockerfile' "$tools/bin/hadolint" Dockerfile
    checked 'the image holds a release build' holds_release Dockerfile
    sed 's/ --release//' Dockerfile >"$work/Dockerfile"
    refused 'the look for a release build' 'no release build' holds_release "$work/Dockerfile"
    sed 's/^FROM debian:.*/FROM debian/' Dockerfile >"$work/Dockerfile"
    refused hadolint DL3006 "$tools/bin/hadolint" "$work/Dockerfile"
}

compose() { "$tools/bin/docker-compose" --project-directory . --file "$1" --profile '*' config "${@:2}"; }

compose_rules() { compose "$1" --format json | "$tools/bin/python" check/compose.py; }

check_compose() {
    export FLUXGLOBE_SECRETS=$work/secrets
    checked 'secrets are made' ./make-secrets.sh
    checked 'docker compose config' compose compose.yaml --quiet
    checked 'ports, privileges, limits and health checks of the compose file' compose_rules compose.yaml
    sed 's/restart: unless-stopped/restrat: unless-stopped/' compose.yaml >"$work/compose.yaml"
    refused 'docker compose config' restrat compose "$work/compose.yaml" --quiet
    sed 's/"127\.0\.0\.1:/"/' compose.yaml >"$work/compose.yaml"
    refused 'the compose file rules' 'to more than this machine' compose_rules "$work/compose.yaml"
    sed '/EXECUTOR_MEMORY_BYTES:/d' compose.yaml >"$work/compose.yaml"
    refused 'the compose file rules' 'executor may hold 8589934592 bytes' compose_rules "$work/compose.yaml"
    sed '/3.3 GiB/,/memory:/s/memory: 4g/memory: 2g/' compose.yaml >"$work/compose.yaml"
    refused 'the compose file rules' 'tile-server may hold' compose_rules "$work/compose.yaml"
    sed '/TMPDIR:/d' compose.yaml >"$work/compose.yaml"
    refused 'the compose file rules' 'spools large fields in /tmp' compose_rules "$work/compose.yaml"
}

check_prometheus() {
    checked 'promtool check config' "$promtool" check config prometheus/compose.yml prometheus/embedded.yml
    checked 'promtool check rules' "$promtool" check rules prometheus/rules.yml
    checked 'promtool test rules' "$promtool" test rules prometheus/rules.test.yml
    checked 'metrics that rules and dashboards ask for' \
        "$tools/bin/python" -B check/metrics.py .. prometheus/rules.yml grafana/dashboards/*.json ../docs/operations.md
    sed 's/(fluxglobe_scheduler_executors)/(fluxglobe_scheduler_workers)/' prometheus/rules.yml >"$work/rules.yml"
    refused 'the look for metrics' fluxglobe_scheduler_workers "$tools/bin/python" -B check/metrics.py .. "$work/rules.yml"
    cp prometheus/rules.test.yml "$work/"
    sed 's/> 0\.05/> 0.5/' prometheus/rules.yml >"$work/rules.yml"
    refused 'promtool test rules' FluxglobeErrors "$promtool" test rules "$work/rules.test.yml"
}

check_grafana() {
    checked 'dashboards are written' "$tools/bin/python" -B grafana/make.py "$work/dashboards"
    checked 'dashboards are what grafana/make.py writes' diff --recursive "$work/dashboards" grafana/dashboards
    "$tools/bin/python" check/queries.py grafana/dashboards/*.json >"$work/queries.yml"
    checked "promtool of the dashboards' queries" "$promtool" check rules "$work/queries.yml"
    sed 's/histogram_quantile(/histogram_quantil(/' "$work/queries.yml" >"$work/fault.yml"
    refused "promtool of the dashboards' queries" histogram_quantil "$promtool" check rules "$work/fault.yml"
}

# helm COMMAND...: without its remarks on our symbolic links, which name files outside the chart on purpose.
helm() {
    local status=0
    "$tools/bin/helm" "$@" 2>"$work/remarks" || status=$?
    grep --invert-match 'found symbolic link' "$work/remarks" >&2 || true
    return "$status"
}

schemas_of() {
    "$tools/bin/kubeconform" -strict -summary \
        -schema-location "$tools/schemas/$1/{{.ResourceKind}}{{.KindSuffix}}.json" \
        -schema-location "$tools/schemas/custom/{{.ResourceKind}}{{.KindSuffix}}.json" "${@:2}"
}

check_chart() {
    local version values made
    for version in 1.30 1.37; do
        made=()
        for values in helm/fluxglobe/values.yaml helm/fluxglobe/ci/*.yaml; do
            made+=("$work/$version-$(basename "$values")")
            checked "helm lint, $(basename "$values"), Kubernetes $version" \
                helm lint --strict --quiet --kube-version "$version.0" --values "$values" helm/fluxglobe
            helm template test helm/fluxglobe --namespace ocean --kube-version "$version.0" --values "$values" >"${made[-1]}"
        done
        checked "kubeconform of what they make, Kubernetes $version" schemas_of "$version" "${made[@]}"
    done
    refused 'the values schema' /kafka/security helm lint --kube-version 1.37.0 --set kafka.security=none helm/fluxglobe
    refused 'the values schema' /postgis/url \
        helm lint --kube-version 1.37.0 --set postgis.url=postgres://me:secret@host/database helm/fluxglobe
    checked 'tile servers are told who asks' tells_clients "$work/1.37-everything.yaml"
    refused 'the look for FLUXGLOBE_CLIENT_HEADER' 'all are one client' tells_clients "$work/1.37-values.yaml"
    refused 'the chart' 'believed from whoever connects' \
        helm template test helm/fluxglobe --kube-version 1.37.0 --set tileServer.clientHeader=x-forwarded-for
    checked 'workers on a GPU refuse to draw without it' requires_gpu "$work/1.37-everything.yaml"
    helm template test helm/fluxglobe --kube-version 1.37.0 --set renderWorker.gpu.enabled=false >"$work/no-gpu.yaml"
    refused 'the look for FLUXGLOBE_REQUIRE_GPU' 'no worker' requires_gpu "$work/no-gpu.yaml"
    sed 's/formula: queries/formulae: queries/' "$work/1.37-everything.yaml" >"$work/fault.yaml"
    refused kubeconform formulae schemas_of 1.37 "$work/fault.yaml"
    sed 's/runAsNonRoot: true/runAsNonRoot: "yes"/' "$work/1.37-everything.yaml" >"$work/fault.yaml"
    refused kubeconform runAsNonRoot schemas_of 1.37 "$work/fault.yaml"
}

tells_clients() {
    grep --quiet 'name: FLUXGLOBE_CLIENT_HEADER, value: "x-forwarded-for"' "$1" || { echo 'all are one client' && return 1; }
}

requires_gpu() { grep --quiet 'name: FLUXGLOBE_REQUIRE_GPU, value: "true"' "$1" || { echo 'no worker requires a GPU' && return 1; }; }

check_unit() {
    local unit
    for unit in fluxglobe.service fluxglobe@.service; do
        checked "folders and secrets of $unit" "$tools/bin/python" -B check/unit.py "$unit"
    done
    sed '/^StateDirectory=/d' fluxglobe@.service >"$work/fluxglobe@.service"
    refused 'the look at a unit'"'"'s folders' 'has no StateDirectory' "$tools/bin/python" -B check/unit.py "$work/fluxglobe@.service"
    sed 's|EXECUTOR_WORK=%S/fluxglobe-%i/|EXECUTOR_WORK=|' fluxglobe@.service >"$work/fluxglobe@.service"
    refused 'the look at a unit'"'"'s folders' 'cannot write FLUXGLOBE_EXECUTOR_WORK' "$tools/bin/python" -B check/unit.py "$work/fluxglobe@.service"
    sed '/KAFKA_PASSWORD_FILE/d' fluxglobe@.service >"$work/fluxglobe@.service"
    refused 'the look at a unit'"'"'s secrets' FLUXGLOBE_KAFKA_PASSWORD_FILE "$tools/bin/python" -B check/unit.py "$work/fluxglobe@.service"
    sed '/^User=/d' fluxglobe@.service >"$work/fluxglobe@.service"
    refused 'the look at a unit'"'"'s user' 'one user for all services' "$tools/bin/python" -B check/unit.py "$work/fluxglobe@.service"
    sed 's/^User=.*/DynamicUser=yes/' fluxglobe.service >"$work/fluxglobe.service"
    refused 'the look at a unit'"'"'s user' 'no user that can land files' "$tools/bin/python" -B check/unit.py "$work/fluxglobe.service"
    sed '/^StartLimitIntervalSec=/d' fluxglobe@.service >"$work/fluxglobe@.service"
    refused 'the look at a unit'"'"'s starts' 'gives up' "$tools/bin/python" -B check/unit.py "$work/fluxglobe@.service"
    if ! command -v systemd-analyze >/dev/null; then
        printf 'deploy: unit: systemd-analyze is not on this machine, left out\n'
        return
    fi
    # It wants the program to be there.
    for unit in fluxglobe.service fluxglobe@{ingestd,scheduler,executor,render-worker,tile-server}.service; do
        sed 's|^ExecStart=[^ ]*|ExecStart=/bin/true|' "${unit/@*./@.}" >"$work/$unit"
        checked "systemd-analyze verify $unit" unit_without_remarks "$work/$unit"
    done
    sed 's|^NoNewPrivileges|NoNewRights|' "$work/fluxglobe.service" >"$work/fault.service"
    refused 'systemd-analyze verify' NoNewRights unit_without_remarks "$work/fault.service"
}

# systemd-analyze only remarks on unknown names.
unit_without_remarks() {
    systemd-analyze verify "$1" >"$work/remarks" 2>&1
    cat "$work/remarks"
    ! [ -s "$work/remarks" ]
}

gallery() { python3 -B ../gallery/make.py --check --list "$1" "${@:2}"; }

check_gallery() {
    checked 'docs/gallery.md and its pictures are what gallery/list.toml says' gallery ../gallery/list.toml
    sed 's/--tilt /--tilt 1/' ../gallery/list.toml >"$work/list.toml"
    refused 'the look at the gallery' 'drawn by another command' gallery "$work/list.toml"
    sed 's/^title = "/title = "No /' ../gallery/list.toml >"$work/list.toml"
    refused 'the look at the gallery' 'is not what the list gives' gallery "$work/list.toml"
    sed 's/^text = /test = /' ../gallery/list.toml >"$work/list.toml"
    refused 'the look at the gallery' 'text is missing' gallery "$work/list.toml"
    sed 's/RENDERER_VERSION: u32 = /&9/' ../contract/src/job.rs >"$work/job.rs"
    refused 'the look at the gallery' 'was drawn by renderer version' gallery ../gallery/list.toml --job "$work/job.rs"
    sed 's/ANNOTATION_VERSION: u32 = /&9/' ../contract/src/annotation.rs >"$work/annotation.rs"
    refused 'the look at the gallery' 'was drawn by annotations version' gallery ../gallery/list.toml --annotation "$work/annotation.rs"
}

check/install.sh
if ! [ -x "$promtool" ]; then services/prometheus.sh install; fi
if [ $# = 0 ]; then set -- shell node image compose prometheus grafana chart unit gallery; fi
for name in "$@"; do "check_$name"; done
printf '%d passed, 0 failed\n' "$ran"
