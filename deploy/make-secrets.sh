#!/usr/bin/env bash
# Makes the secrets that compose.yaml reads, once: what is there already stays.
#   deploy/make-secrets.sh [FOLDER]      default: deploy/secrets, or $FLUXGLOBE_SECRETS
# The folder is closed to other users. The files in it are not: the containers' users, who have other numbers than
# the owner's, must read them, and compose mounts each into the containers that need it and into no other.
set -euo pipefail

folder=${1:-${FLUXGLOBE_SECRETS:-$(dirname "$0")/secrets}}
mkdir -p "$folder"
chmod 700 "$folder"
umask 022

make() {
    local file=$folder/$1
    if [ -e "$file" ]; then return; fi
    cat >"$file.new"
    mv "$file.new" "$file"
    printf 'secrets: made %s\n' "$file" >&2
}

random() { head -c 24 /dev/urandom | base64 | tr '+/' '-_'; }

random | tr -d '\n' | make postgis_password
random | tr -d '\n' | make grafana_password
# The S3 server and its clients know the same pair under different names.
if ! [ -e "$folder/s3.env" ] || ! [ -e "$folder/s3_server.env" ]; then
    rm -f "$folder/s3.env" "$folder/s3_server.env"
    secret_key=$(random)
    printf 'AWS_ACCESS_KEY_ID=fluxglobe\nAWS_SECRET_ACCESS_KEY=%s\n' "$secret_key" | make s3.env
    printf 'ROOT_ACCESS_KEY=fluxglobe\nROOT_SECRET_KEY=%s\n' "$secret_key" | make s3_server.env
fi
