use crate::primitives::{Builder, DVec2, DVec3, Sampler, block, dvec2, dvec3};

/// The usual sizes of cabinets: ranges of depth, width and height, metres (Neufert's Architects'
/// Data; base units of kitchens are 0.85 to 0.9 m high, EN 1116).
const SIZES_M: [[[f64; 2]; 3]; 5] = [
    // Wardrobe.
    [[0.5, 0.65], [0.8, 2.2], [1.8, 2.3]],
    // Sideboard or chest of drawers.
    [[0.38, 0.52], [0.7, 2.0], [0.6, 1.1]],
    // Filing cabinet.
    [[0.5, 0.65], [0.38, 0.48], [0.7, 1.4]],
    // Kitchen unit.
    [[0.55, 0.62], [0.4, 2.4], [0.85, 0.92]],
    // Locker or refrigerator.
    [[0.5, 0.7], [0.3, 0.75], [1.4, 1.9]],
];

/// Builds a cabinet that faces +x.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let [deep_m, wide_m, high_m] = s.pick(&SIZES_M).map(|[low, high]| s.uniform(low, high));
    let feet_m = s.pick(&[0.0, 0.05, 0.1, 0.15]);
    let size = dvec3(deep_m, wide_m, high_m - feet_m);
    block(b, (feet_m + 0.5 * size.z) * DVec3::Z, size);
    for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let half = 0.5 * dvec2(deep_m, wide_m) - 0.04;
        let foot = dvec3(x * half.x, y * half.y, 0.5 * feet_m);
        // Some cabinets have no feet.
        if feet_m > 0.0 {
            block(b, foot, dvec3(0.04, 0.04, feet_m));
        }
    }
    let columns = (wide_m / s.uniform(0.4, 0.7)).round().max(1.0) as usize;
    let drawers = s.count(2, 4);
    let mixed = s.chance(0.5);
    for column in 0..columns {
        let rows = if mixed && s.chance(0.5) { drawers } else { 1 };
        let cell = dvec2(wide_m / columns as f64, size.z / rows as f64);
        for row in 0..rows {
            let y = (column as f64 + 0.5) * cell.x - 0.5 * wide_m;
            let z = feet_m + (row as f64 + 0.5) * cell.y;
            panel(b, dvec3(0.5 * deep_m, y, z), cell, rows == 1);
        }
    }
    if s.chance(0.3) {
        block(b, (high_m + 0.015) * DVec3::Z, dvec3(deep_m + 0.04, wide_m + 0.04, 0.03));
    }
}

/// The front of a door or a drawer, and its handle.
fn panel(b: &mut Builder, middle: DVec3, cell: DVec2, door: bool) {
    let thick_m = 0.018;
    let front = middle + 0.5 * thick_m * DVec3::X;
    block(b, front, dvec3(thick_m, cell.x - 0.01, cell.y - 0.01));
    let handle = front + 0.03 * DVec3::X;
    if door {
        block(b, handle + (0.5 * cell.x - 0.05) * DVec3::Y, dvec3(0.02, 0.015, 0.16));
    } else {
        block(b, handle, dvec3(0.02, 0.16, 0.015));
    }
}
