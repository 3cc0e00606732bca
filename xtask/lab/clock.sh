#!/usr/bin/env bash
# What a newcomer waits for, in CPU-seconds (user and system), which other work on
# the machine changes less than it changes the time on the clock:
#
#   first scan   `cargo xtask gen-dataset` in a fresh clone, to the end of a dataset
#                of one mesh
#   test, cold   `cargo xtask test` in a fresh clone
#   test, warm   the same once more
#
# usage: xtask/lab/clock.sh [scan | test | all] [flags of `cargo xtask test`]
#
# Sources of dependencies come from Cargo's own cache, so that a network's speed
# does not count. To see where the time of a build goes, run `cargo build --release
# --timings -p edgepuck --no-default-features` in the clone, whose folder is printed.
set -euo pipefail

what="${1:-all}"
[ $# -eq 0 ] || shift
root="$(git -C "$(dirname "$0")" rev-parse --show-toplevel)"
folder="$(mktemp -d)"
clone="$folder/edgepuck"
git clone --quiet "$root" "$clone"
# Tests find the developers' data beside the clone, if it is beside the original.
[ ! -d "$root/../shared" ] || ln -s "$(cd "$root/../shared" && pwd)" "$folder/shared"
cd "$clone"
unset CARGO_TARGET_DIR
cargo fetch --quiet
cargo fetch --quiet --manifest-path xtask/lab/Cargo.toml
echo "clone: $clone, commit $(git rev-parse --short HEAD), load $(cut -d' ' -f1-3 /proc/loadavg)"

# Runs a command and prints its CPU-seconds and its seconds on the clock.
clock() {
    local name="$1" status=0
    shift
    TIMEFORMAT='%U %S %R'
    { time "$@" >"$folder/output" 2>&1 || status=$?; } 2>"$folder/times"
    awk -v name="$name" -v status="$status" \
        '{ printf "%-12s %6.0f CPU-s %6.0f s, exit code %d\n", name, $1 + $2, $3, status }' \
        "$folder/times"
    tail -n 1 "$folder/output"
}

mesh="$clone/assets/meshes/chair"
if [ "$what" = scan ] || [ "$what" = all ]; then
    clock "first scan" cargo xtask gen-dataset "$mesh" --out "$folder/data"
    rm -rf target
fi
if [ "$what" = test ] || [ "$what" = all ]; then
    clock "test, cold" cargo xtask test "$@"
    clock "test, warm" cargo xtask test "$@"
fi
