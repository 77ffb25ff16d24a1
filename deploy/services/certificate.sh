# shellcheck shell=bash
# A certificate of a server on this machine that vouches for itself, made with openssl.

# make_certificate KEY CERTIFICATE: two files in PEM, the key for its owner's eyes only.
make_certificate() {
    (
        umask 077
        # shellcheck disable=SC2154 # process.sh names the log
        openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 3650 -subj /CN=localhost \
            -addext subjectAltName=DNS:localhost,IP:127.0.0.1 -keyout "$1" -out "$2" 2>>"$log"
        chmod 644 "$2"
    ) || fail "could not make its certificate; its log: $log"
}
