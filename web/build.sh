#!/bin/sh
# Builds the page into the folder OUT, from where any server of files can show it:
#   sh web/build.sh OUT
# It needs Rust's standard library for wasm32-unknown-unknown and, in the PATH or in target/tools/bin,
# wasm-bindgen; where npm has installed web/package.json, wasm-opt makes it smaller.
set -eu

out="${1:?a folder to write to}"
root="$(cd "$(dirname "$0")/.." && pwd)"
version="$(sed -n 's/^wasm-bindgen = "=\(.*\)"/\1/p' "$root/Cargo.toml")"
PATH="$root/target/tools/bin:$PATH"

if [ "$(wasm-bindgen --version 2>/dev/null)" != "wasm-bindgen $version" ]; then
    cargo install wasm-bindgen-cli --version "$version" --locked --bin wasm-bindgen --root "$root/target/tools"
fi
mkdir -p "$out"
out="$(cd "$out" && pwd)"
cd "$root"
# Without the names of functions, which are for debuggers.
cargo build --package edgepuck-web --lib --profile web --target wasm32-unknown-unknown
built="${CARGO_TARGET_DIR:-target}/wasm32-unknown-unknown/web/edgepuck_web.wasm"
wasm-bindgen --target web --no-typescript --remove-name-section --out-dir "$out" "$built"
wasm_opt=web/node_modules/.bin/wasm-opt
if [ -x "$wasm_opt" ]; then
    "$wasm_opt" -O3 --all-features -o "$out/smaller.wasm" "$out/edgepuck_web_bg.wasm"
    mv "$out/smaller.wasm" "$out/edgepuck_web_bg.wasm"
fi
cp web/page/* assets/view/viewer.js assets/weights/edge-64.safetensors \
    assets/weights/shapes-rotational-64.safetensors "$out"
