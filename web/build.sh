#!/bin/sh
# Builds the page into the folder OUT, from where any server of files can show it:
#   sh web/build.sh OUT
# It needs Rust's standard library for wasm32-unknown-unknown. EDGEPUCK_PROFILE names a profile of Cargo that
# compiles faster than `web`.
set -eu

out="${1:?a folder to write to}"
root="$(cd "$(dirname "$0")/.." && pwd)"

mkdir -p "$out"
out="$(cd "$out" && pwd)"
cd "$root"
target="${CARGO_TARGET_DIR:-target}"
profile="${EDGEPUCK_PROFILE:-web}"
case "$profile" in
    dev | test) built=debug ;;
    *) built="$profile" ;;
esac
cargo build --package edgepuck-web --lib --profile "$profile" --target wasm32-unknown-unknown
cargo run --manifest-path web/bindgen/Cargo.toml --target-dir "$target/bindgen" -- \
    "$target/wasm32-unknown-unknown/$built/edgepuck_web.wasm" "$out"
cp web/page/* assets/view/viewer.js assets/weights/edge-64.safetensors \
    assets/weights/shapes-rotational-64.safetensors "$out"
