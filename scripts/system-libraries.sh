#!/bin/sh
# Install the Debian packages named, where they are missing and the user may; else say in one sentence what to do.
set -eu

has_library() { # package -> whether the loader finds its library, whoever installed it
    case "$1" in
        libusb-1.0-0) name=libusb-1.0.so.0 ;;
        libgl1) name=libGL.so.1 ;;
        libegl1) name=libEGL.so.1 ;;
        libgomp1) name=libgomp.so.1 ;;
        *) return 1 ;;
    esac
    python3 -c "import ctypes; ctypes.CDLL('$name')" 2>/dev/null
}

[ "$(uname -s)" = Linux ] || exit 0
missing=""
for package in "$@"; do
    has_library "$package" || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

if command -v apt-get >/dev/null 2>&1; then
    if [ "$(id -u)" = 0 ]; then
        as_root=""
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
        as_root="sudo"
    else
        as_root="none"
    fi
    if [ "$as_root" != none ]; then
        echo "Installing the system libraries$missing."
        $as_root apt-get update -qq >/dev/null 2>&1 || true
        # shellcheck disable=SC2086
        if $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $missing >/dev/null; then
            exit 0
        fi
    fi
fi
echo "Open3D needs these system libraries, which could not be installed from here:$missing (Debian and Ubuntu names)." >&2
exit 1
