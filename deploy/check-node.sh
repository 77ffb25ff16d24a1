#!/usr/bin/env bash
# Ends with 1 and says what to do where Node is missing or too old or odd to build the viewer.
#   deploy/check-node.sh [VERSION]     VERSION as `node --version` says it; asked of node if it is not given
# What runs in Node is Vite 6, Vitest 3 and what checks types and files, which want an even version from 18 on or any from
# 22 on; dependency-cruiser and openapi-typescript want 18.17. Cesium asks for 22 for building Cesium itself: here it runs in the browser, and npm only remarks on it.
set -euo pipefail

say() { printf 'viewer: %s\n' "$*" >&2; }
advice='install Node 22 (https://nodejs.org), or Debian 12: apt-get install nodejs npm'

version=${1:-}
if [ -z "$version" ]; then
    if ! command -v node >/dev/null; then
        say "node is missing; $advice"
        exit 1
    fi
    version=$(node --version)
fi
IFS=. read -r major minor _ <<<"${version#v}"
if ! [[ $major =~ ^[0-9]+$ && ${minor:-0} =~ ^[0-9]+$ ]]; then
    say "node says that its version is \"$version\", which is none; $advice"
    exit 1
fi
if [ "$major" -ge 22 ] || [ "$major" = 20 ] || { [ "$major" = 18 ] && [ "${minor:-0}" -ge 17 ]; }; then exit 0; fi
say "node is $version, and the viewer is built with 18.17 or newer, 20, or 22 and newer; $advice"
exit 1
