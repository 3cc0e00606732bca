#!/bin/sh
# Installs what tests need beyond Rust: software Vulkan, and a C++ compiler for
# the fuzz targets. Both the README and CI run this, through `cargo xtask test`.
set -eu

packages="mesa-vulkan-drivers libvulkan1 g++"

if command -v rustup >/dev/null 2>&1; then
    cargo fmt --version >/dev/null 2>&1 || rustup component add rustfmt
    cargo clippy --version >/dev/null 2>&1 || rustup component add clippy
fi

missing=""
for package in $packages; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
# Debian 12's own Mesa 22.3 traces at half the speed of its backport 25.0.
case "$(dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null || true)" in
    22.3.*deb12*) missing="$missing mesa-vulkan-drivers libvulkan1" ;;
esac
if [ -z "$missing" ]; then
    echo "All packages are there: $packages"
    exit 0
fi
if ! command -v apt-get >/dev/null 2>&1; then
    echo "No apt-get here: install the equivalents of$missing yourself if tests fail." >&2
    exit 0
fi
root=""
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null 2>&1; then
        echo "Neither root nor sudo: ask for$missing to be installed if tests fail." >&2
        exit 0
    fi
    root="sudo"
fi

echo "Installing:$missing"
. /etc/os-release
release=""
if [ "${VERSION_CODENAME:-}" = bookworm ]; then
    echo "deb http://deb.debian.org/debian bookworm-backports main" |
        $root tee /etc/apt/sources.list.d/edgepuck-backports.list >/dev/null
    release="-t bookworm-backports"
fi
$root apt-get update -qq
# shellcheck disable=SC2086
$root apt-get install -y -qq --no-install-recommends $release $missing
