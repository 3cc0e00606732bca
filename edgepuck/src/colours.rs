//! The colours of all pictures and pages, from one table that the viewer's JavaScript reads as well.

use serde::Deserialize;
use std::collections::HashMap;
use std::sync::LazyLock;

/// Red, green and blue, 0 to 255.
pub type Rgb = [u8; 3];

/// The table: colours as `#rrggbb`.
#[derive(Deserialize)]
struct Table {
    /// From the least value to the greatest.
    ramp: Vec<String>,
    /// Of objects, clusters and tracks by their numbers.
    palette: Vec<String>,
    /// Of classes by their names.
    classes: HashMap<String, String>,
    /// The names of SemanticKITTI's labels (semantic-kitti.yaml of semantic-kitti-api).
    semantic_kitti: HashMap<u16, String>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    serde_json::from_str(edgepuck_assets::COLOURS).expect("invariant: the table is valid")
});

/// The colour at this share of the ramp, 0 to 1; grey for NaN.
pub fn on_ramp(share: f64) -> Rgb {
    if share.is_nan() {
        return [150; 3];
    }
    let place = share.clamp(0.0, 1.0) * (TABLE.ramp.len() - 1) as f64;
    let [left, right] = [place.floor(), place.ceil()].map(|at| rgb(&TABLE.ramp[at as usize]));
    let mixed = |left: u8, right: u8| {
        (f64::from(left) + (f64::from(right) - f64::from(left)) * place.fract()).round() as u8
    };
    [0, 1, 2].map(|channel| mixed(left[channel], right[channel]))
}

/// The colour of the object, cluster or track with this number.
pub fn of_number(number: u32) -> Rgb {
    rgb(&TABLE.palette[number as usize % TABLE.palette.len()])
}

/// The colour of a class; of one that the table lacks, by a hash of its name.
pub fn of_class(name: &str) -> Rgb {
    // FNV-1a, as in assets/view/src/colour.js.
    let hash = |hash: u32, byte: u8| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
    match TABLE.classes.get(name) {
        Some(colour) => rgb(colour),
        None => of_number(name.bytes().fold(0x811c_9dc5, hash)),
    }
}

/// The class of a label of SemanticKITTI.
pub fn semantic_kitti(label: u16) -> &'static str {
    TABLE.semantic_kitti.get(&label).map_or("other", String::as_str)
}

fn rgb(colour: &str) -> Rgb {
    let number = u32::from_str_radix(colour.trim_start_matches('#'), 16);
    let [_, red, green, blue] = number.expect("invariant: #rrggbb").to_be_bytes();
    [red, green, blue]
}
