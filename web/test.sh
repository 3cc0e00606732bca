#!/bin/sh
# Tests the page in Chromium: sh web/test.sh
# It prints SKIPPED with the reason and exits with 77 where a browser, node or npm is missing.
set -eu

skip() {
    echo "SKIPPED: $1"
    exit 77
}

cd "$(dirname "$0")"
chromium="${CHROMIUM:-/usr/bin/chromium}"
[ -x "$chromium" ] || skip "there is no $chromium"
command -v node >/dev/null || skip "there is no node"
command -v npm >/dev/null || skip "there is no npm"
(cd ../assets/view && npm ci --silent) || skip "npm could not install the packages of assets/view"

out="${CARGO_TARGET_DIR:-../target}/web"
rm -rf "$out"
sh build.sh "$out/page"
cargo run --profile test --package edgepuck-web --example traced -- "$out/traced"
CHROMIUM="$chromium" node test/browser.mjs "$out/page" "$out/traced"
