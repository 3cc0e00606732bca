#!/bin/sh
# Leaves one thing at a time out of the street scenes or of the network's recipe, trains on
# what is left, and shows what each network makes of real objects.
#
#     xtask/lab/ablate_street.sh WORK_FOLDER REAL.npz...
#
# Each row is one scene recipe and one training recipe, made here from the shipped ones, with
# fewer scenes and epochs, so that a row takes under a minute on two cores. One seed a row.
set -eu

scenes=400
epochs=8
# The program that does all of it.
edgepuck=${EDGEPUCK:-cargo xtask}
work=$1
shift
mkdir -p "$work"
street=assets/scenes/street.toml
network=assets/recipes/street-128.toml
real=""
for file in "$@"; do real="$real --data $file"; done

# Scene recipes.
known='car|person|two-wheeler|truck|bus'
without_negatives() {
    awk -v known="^class = \"($known)\"" '
        /^\[\[object\]\]/ { flush(); in_object = 1; kept = 0 }
        function flush() { if (!in_object || kept) printf "%s", block; block = "" }
        in_object && $0 ~ known { kept = 1 }
        { block = block $0 "\n" }
        END { flush() }' "$street"
}
flat() { sed -E 's/^(slope_deg|roughness_m|kerb_m) = .*/\1 = [0, 0]/; s/^tilt_deg = .*/tilt_deg = [0, 0]/' "$street"; }
opaque() { sed 's/^glass_returned = .*/glass_returned = [1, 1]/' "$street"; }
near() { sed 's/^distance_m = .*/distance_m = [2.5, 4]/' "$street"; }
alone() { sed 's/^count = .*/count = [0, 1]/' "$street"; }
exact() { sed 's/^noise_m = .*/noise_m = 0/; s/^dropout = .*/dropout = 0/' "$street"; }

# Recipes of the network.
shorter() { sed "s/^epochs = .*/epochs = $epochs/" "$network"; }
unturned() { shorter | sed 's/"metric-sight"/"metric"/; s/^rotate_degrees = .*/rotate_degrees = 180/'; }
unvaried() { shorter | sed '/^\[clusters\]/,$d'; }

# row NAME SCENES RECIPE [FLAGS OF gen-scenes]
row() {
    name=$1 data=$2 recipe=$3
    shift 3
    if [ ! -f "$work/$data/packed/train.npz" ]; then
        $edgepuck gen-scenes "$work/$data.toml" --sweeps $scenes --seed 4 --save 0 \
            --out "$work/$data" "$@" >"$work/$data.log" 2>&1
    fi
    model="$work/$data-$recipe.safetensors"
    $edgepuck train --data "$work/$data/packed" --recipe "$work/$recipe-recipe.toml" \
        --out "$model" >"$work/$data-$recipe.log" 2>&1
    # shellcheck disable=SC2086 # One flag a file.
    $edgepuck eval --model "$model" $real --known car,person --min-points 100 2>&1 |
        tee "$work/$data-$recipe.eval" | awk -v name="$name" '
            $2 == "all" { share[$1] = $6 " %" }
            END {
                printf "| %s | %s | %s | %s |\n", name, share["car"], share["person"], share["negatives"]
            }'
}

cp "$street" "$work/street.toml"
cp "$street" "$work/one-sensor.toml"
without_negatives >"$work/no-negatives.toml"
flat >"$work/flat.toml"
opaque >"$work/opaque.toml"
near >"$work/near.toml"
alone >"$work/alone.toml"
exact >"$work/exact.toml"
shorter >"$work/whole-recipe.toml"
unturned >"$work/unturned-recipe.toml"
unvaried >"$work/unvaried-recipe.toml"
# Without negatives nothing is unknown but what was cut wrongly.
shorter | sed 's/^unknown = .*/unknown = ["other"]/' >"$work/known-recipe.toml"

echo "| left out | cars | persons | negatives called neither |"
echo "|---|---|---|---|"
row "nothing" street whole
row "turn to the line of sight (any yaw instead)" street unturned
row "thinning, cuts, strays and strips of ground in training" street unvaried
row "negatives" no-negatives known
row "slopes, kerbs, roughness, tilt" flat whole
row "glass" opaque whole
row "distances: all objects at 2.5 to 4 m" near whole
row "most neighbours: at most one object of each entry" alone whole
row "range noise and dropout" exact whole
row "sensors: HDL-64E alone" one-sensor whole --sensor hdl64e
