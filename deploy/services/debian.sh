# shellcheck shell=bash
# Debian packages: in goes a package and a file it brings, out comes the file, installed through apt when it is missing.
# Root is asked for through apt only, with sudo when the caller is not root.

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    else
        command -v sudo >/dev/null || fail "not root and no sudo; as root run: $*"
        sudo "$@"
    fi
}

apt_get() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600 "$@" >/dev/null
}

# need_package PACKAGE FILE_PATTERN
need_package() {
    # shellcheck disable=SC2086 # the file may be a pattern
    if compgen -G $2 >/dev/null; then return; fi
    say "installing the Debian package $1"
    # Lists that are missing or old name versions that are gone: renew them once.
    apt_get install -y --no-install-recommends "$1" || {
        apt_get update
        apt_get install -y --no-install-recommends "$1"
    }
}

# unpack_package PACKAGE FOLDER: the files of a package in a folder of ours, without installing it: no root, and no system
# service that starts by itself. apt checks the archive against the signed lists.
unpack_package() {
    local work
    work=$(mktemp -d "$2.XXXXXX")
    (
        cd "$work" || exit
        apt-get -qq -o APT::Sandbox::User= download "$1" || {
            apt_get update
            apt-get -qq -o APT::Sandbox::User= download "$1"
        }
        mkdir files
        dpkg-deb -x ./*.deb files
    )
    rm -rf "$2"
    mv "$work/files" "$2"
    rm -rf "$work"
}
