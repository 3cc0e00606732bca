#!/bin/sh
# Builds the page into the folder OUT, from where any server of files can show it:
#   sh web/build.sh OUT
# It needs Rust's standard library for wasm32-unknown-unknown.
set -eu

out="${1:?a folder to write to}"
root="$(cd "$(dirname "$0")/.." && pwd)"

mkdir -p "$out"
out="$(cd "$out" && pwd)"
cd "$root"
target="${CARGO_TARGET_DIR:-target}"
cargo build --package edgepuck-web --lib --profile web --target wasm32-unknown-unknown
cargo run --manifest-path web/bindgen/Cargo.toml --target-dir "$target/bindgen" -- \
    "$target/wasm32-unknown-unknown/web/edgepuck_web.wasm" "$out"
cp web/page/* assets/view/viewer.js assets/weights/edge-64.safetensors \
    assets/weights/shapes-rotational-64.safetensors "$out"
