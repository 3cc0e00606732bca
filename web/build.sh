#!/bin/sh
# Builds the page into the folder OUT, from where any server of files can show it:
#   sh web/build.sh OUT
# It needs Rust's standard library for wasm32-unknown-unknown; where npm has installed web/package.json,
# wasm-opt makes the page smaller.
set -eu

out="${1:?a folder to write to}"
root="$(cd "$(dirname "$0")/.." && pwd)"

mkdir -p "$out"
out="$(cd "$out" && pwd)"
cd "$root"
target="${CARGO_TARGET_DIR:-target}"
cargo build --package edgepuck-web --lib --profile web --target wasm32-unknown-unknown
cargo run --release --manifest-path web/bindgen/Cargo.toml --target-dir "$target/bindgen" -- \
    "$target/wasm32-unknown-unknown/web/edgepuck_web.wasm" "$out"
wasm_opt=web/node_modules/.bin/wasm-opt
if [ -x "$wasm_opt" ]; then
    # What Rust takes for granted of WebAssembly, and vectors.
    "$wasm_opt" -O3 --enable-simd --enable-bulk-memory --enable-nontrapping-float-to-int --enable-sign-ext \
        --enable-mutable-globals --enable-reference-types --enable-multivalue \
        -o "$out/smaller.wasm" "$out/edgepuck_web_bg.wasm"
    mv "$out/smaller.wasm" "$out/edgepuck_web_bg.wasm"
fi
cp web/page/* assets/view/viewer.js assets/weights/edge-64.safetensors \
    assets/weights/shapes-rotational-64.safetensors "$out"
