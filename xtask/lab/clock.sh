#!/usr/bin/env bash
# What users and developers wait for, in CPU-seconds (user and system), which other work on
# the machine changes less than it changes the time on the clock:
#
#   scan      `cargo xtask gen-dataset` in a fresh clone, to the end of a dataset of one mesh
#   install   `cargo install --path edgepuck`
#   pip       `pip install ./python`
#   test      `cargo xtask test`
#   all       `cargo xtask test --all`
#
# usage: xtask/lab/clock.sh [--beside COMMIT] [STEP ...]        (default: scan)
#
# With --beside, each step is measured in a clone of COMMIT, then in one of HEAD, and their ratio is
# printed; a commit without `--all` runs `cargo xtask test` for it. Each step builds from nothing, but
# takes sources of dependencies and Python environments that earlier steps downloaded.
# To see where the time of a build goes, run `cargo build --release --timings -p edgepuck
# --no-default-features` in a clone, whose folder is printed.
set -euo pipefail

root="$(git -C "$(dirname "$0")" rev-parse --show-toplevel)"
commits=(HEAD)
if [ "${1:-}" = --beside ]; then
    commits=("${2:?a commit}" HEAD)
    shift 2
fi
[ $# -gt 0 ] || set -- scan
folder="$(mktemp -d)"
# Tests find the developers' data beside the clone, if it is beside the original.
[ ! -d "$root/../shared" ] || ln -s "$(cd "$root/../shared" && pwd)" "$folder/shared"
unset CARGO_TARGET_DIR

for commit in "${commits[@]}"; do
    name="$(git -C "$root" rev-parse --short "$commit")"
    git clone --quiet "$root" "$folder/$name"
    git -C "$folder/$name" checkout --quiet --detach "$(git -C "$root" rev-parse "$commit")"
    (cd "$folder/$name" && cargo fetch --quiet)
    clones="${clones:-} $name"
done
echo "clones in $folder, load $(cut -d' ' -f1-3 /proc/loadavg)"

# What a step runs in a clone.
run() {
    case "$1" in
        scan) cargo xtask gen-dataset assets/meshes/chair --out "$folder/data-$2" ;;
        install) cargo install --path edgepuck --root "$folder/installed-$2" ;;
        pip) python3 -m venv "$folder/venv-$2" && "$folder/venv-$2/bin/pip" install ./python ;;
        test) cargo xtask test ;;
        all) if [[ "$(cargo xtask test --help)" == *--all* ]]; then cargo xtask test --all; else cargo xtask test; fi ;;
        *) echo "expected a step: scan, install, pip, test or all, found $1" && return 2 ;;
    esac
}

# Runs a step in a clone, prints its CPU-seconds and its seconds on the clock, and sets `cpu_s`.
clock() {
    local status=0
    find "$folder/$2/target" -mindepth 1 -maxdepth 1 ! -name peers -exec rm -rf {} + 2>/dev/null || true
    TIMEFORMAT='%U %S %R'
    { time (cd "$folder/$2" && run "$1" "$2" >"$folder/$1-$2.log" 2>&1) || status=$?; } 2>"$folder/times"
    cpu_s="$(awk '{ printf "%.0f", $1 + $2 }' "$folder/times")"
    awk -v step="$1" -v clone="$2" -v status="$status" \
        '{ printf "%-8s %-9s %6.0f CPU-s %6.0f s, exit code %d\n", step, clone, $1 + $2, $3, status }' "$folder/times"
    [ "$status" -eq 0 ] || tail -n 3 "$folder/$1-$2.log"
}

for step in "$@"; do
    first=""
    for clone in $clones; do
        clock "$step" "$clone"
        if [ -n "$first" ]; then
            awk -v step="$step" -v now="$cpu_s" -v then="$first" \
                'BEGIN { printf "%-8s %.2f of the CPU-seconds\n", step, now / then }'
        fi
        first="$cpu_s"
    done
done
