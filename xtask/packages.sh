#!/bin/sh
# Installs what tests need beyond Rust: software Vulkan, what Open3D links to, PCL, a browser, PyTorch for
# the documentation's examples, for the Raspberry Pi an emulator and a model of its core, and the standard
# libraries of the targets that code is checked for: the Raspberry Pi and WebAssembly.
# `packages.sh all` adds those of all checks: a C++ compiler for the fuzz targets, what judges Debian packages,
# Slurm, GNU parallel, and systems of Metal and of Direct3D 12. The README runs this through `cargo xtask test`,
# and CI through `cargo xtask test --all`.
set -eu

backported="mesa-vulkan-drivers libvulkan1"
plain="chromium g++ pcl-tools qemu-user libusb-1.0-0"
targets="aarch64-unknown-linux-musl wasm32-unknown-unknown wasm32-wasip1"
if [ "${1:-}" = all ]; then
    plain="$plain lintian munge parallel slurm-wlm"
    targets="$targets aarch64-apple-darwin x86_64-pc-windows-msvc"
fi
# The releases of LLVM whose llvm-mca knows Neoverse N1, the newest first.
llvms="22 21 20 19"

if command -v rustup >/dev/null 2>&1; then
    cargo fmt --version >/dev/null 2>&1 || rustup component add rustfmt
    cargo clippy --version >/dev/null 2>&1 || rustup component add clippy
    for target in $targets; do
        rustup target list --installed | grep -qx "$target" ||
            rustup target add "$target" ||
            echo "Cannot download Rust's standard library for $target:" \
                "checks of the code for that target need it." >&2
    done
else
    echo "No rustup here: install Rust's standard libraries for $targets yourself." >&2
fi

missing_of() {
    for package in $1; do
        dpkg -s "$package" >/dev/null 2>&1 || printf ' %s' "$package"
    done
}
has_llvm_mca() {
    for llvm in $llvms; do
        ! command -v "llvm-mca-$llvm" >/dev/null 2>&1 || return 0
    done
    return 1
}

has_pytorch() {
    /usr/bin/python3 -c "import torch" 2>/dev/null
}

missing_backported="$(missing_of "$backported")"
missing_plain="$(missing_of "$plain")"
# Debian 12's own Mesa 22.3 traces at half the speed of its backport 25.0.
case "$(dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null || true)" in
    22.3.*deb12*) missing_backported=" $backported" ;;
esac
missing="$missing_backported$missing_plain"
has_llvm_mca || missing="$missing llvm"
has_pytorch || missing="$missing python3-torch"
if [ -z "$missing" ]; then
    echo "All packages are installed: $backported $plain llvm python3-torch"
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

# Adds the backports of this Debian from the mirror that the machine's own sources name, with the
# options of that source.
add_backports() {
    # shellcheck disable=SC2016
    entry="$(apt-get indextargets --format '$(SOURCESENTRY)' "Codename: $VERSION_CODENAME" \
        'Created-By: Packages' 'Origin: Debian' 'Component: main' | head -n 1)"
    file="${entry%:*}"
    number="${entry##*:}"
    added="/etc/apt/sources.list.d/edgepuck-backports.${file##*.}"
    # Entry `number` is a paragraph of a .sources file, and a line of a .list file.
    source="$(case "$file" in
        *.sources) awk -v RS= -v number="$number" -v suites="Suites: $backports" 'NR == number {
            sub(/Suites:[^\n]*(\n[ \t][^\n]*)*/, suites); print }' "$file" ;;
        *.list) sed -nE "${number}s|^(deb[[:blank:]]+(\[[^]]*\][[:blank:]]*)?[^[:blank:]]+)\
[[:blank:]]+[^[:blank:]]+|\1 $backports|p" "$file" ;;
    esac)"
    [ -n "$source" ] || return 1
    echo "$source" | $root tee "$added" >/dev/null
    $root apt-get update -qq -o Dir::Etc::sourcelist="$added" -o Dir::Etc::sourceparts=- \
        -o APT::Get::List-Cleanup=0 -o APT::Update::Error-Mode=any && return 0
    $root rm "$added"
    return 1
}

echo "Installing:$missing"
$root apt-get update -qq
. /etc/os-release
release=""
if [ "${VERSION_CODENAME:-}" = bookworm ] && [ -n "$missing_backported" ]; then
    backports="$VERSION_CODENAME-backports"
    # shellcheck disable=SC2016
    known="$(apt-get indextargets --format '$(CODENAME)' "Codename: $backports")"
    if [ -n "$known" ] || add_backports; then
        release="-t $backports"
    else
        echo "The sources of apt name no mirror with $backports:" \
            "installing$missing_backported of $VERSION_CODENAME." >&2
    fi
fi
if ! has_llvm_mca; then
    for llvm in $llvms; do
        if apt-cache show "llvm-$llvm" >/dev/null 2>&1; then
            missing_plain="$missing_plain llvm-$llvm"
            break
        fi
    done
fi
# Tests that need it are skipped where it cannot be installed.
if ! has_pytorch && apt-cache show python3-torch >/dev/null 2>&1; then
    missing_plain="$missing_plain python3-torch"
fi
# The backport of qemu-user is left out: it cannot load plugins.
install="$root apt-get install -y -qq --no-install-recommends"
# shellcheck disable=SC2086
[ -z "$missing_plain" ] || $install $missing_plain
# shellcheck disable=SC2086
[ -z "$missing_backported" ] || $install $release $missing_backported
