#!/bin/sh
# Tests the page in Chromium: sh web/test.sh
# EDGEPUCK_TRACED is the example `traced` if it is built already.
# It prints SKIPPED with the reason and exits with 77 where a browser, node or its packages are missing.
set -eu

skip() {
    echo "SKIPPED: $1"
    exit 77
}

cd "$(dirname "$0")"
chromium="${CHROMIUM:-/usr/bin/chromium}"
[ -x "$chromium" ] || skip "there is no $chromium"
command -v node >/dev/null || skip "there is no node"
[ -d ../assets/view/node_modules ] || skip "there are no packages: run npm ci in assets/view"

out="${CARGO_TARGET_DIR:-../target}/page-test"
rm -rf "$out"
EDGEPUCK_PROFILE=test sh build.sh "$out/page"
if [ -n "${EDGEPUCK_TRACED:-}" ]; then
    "$EDGEPUCK_TRACED" "$out/traced"
else
    cargo run --profile test --package edgepuck-web --example traced -- "$out/traced"
fi
CHROMIUM="$chromium" node test/browser.mjs "$out/page" "$out/traced"
