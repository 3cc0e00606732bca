use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::{Builder, loft, outline};

/// The box of `size` about `centre`; no face shares vertices with another.
pub fn block(b: &mut Builder, centre: DVec3, size: DVec3) {
    let half = size / 2.0;
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            face(b, centre, half, axis, side);
        }
    }
}

pub fn block_between(b: &mut Builder, low: DVec3, high: DVec3) {
    block(b, (low + high) / 2.0, (high - low).abs());
}

/// The face of a box towards `side` of `axis` (0 to 2).
fn face(b: &mut Builder, centre: DVec3, half: DVec3, axis: usize, side: f64) {
    let unit = |index: usize| DVec3::AXES[index % 3] * half[index % 3];
    let (normal, u, v) = (unit(axis) * side, unit(axis + 1) * side, unit(axis + 2));
    let n = [u, v].map(|edge| b.straight(2.0 * edge.length()));
    let at = |share: f64| 2.0 * share - 1.0;
    b.surface(n, |share_u, share_v| centre + normal + at(share_u) * u + at(share_v) * v);
}

/// The box of `size` about `centre` with all edges rounded by `radius_m`, at most half the shortest
/// side: a cushion, a casing.
pub fn cushion(b: &mut Builder, centre: DVec3, size: DVec3, radius_m: f64) {
    let half = size / 2.0;
    let radius_m = radius_m.min(0.999 * half.min_element());
    let n = b.curved(radius_m * FRAC_PI_2, 2);
    let section = |side: f64, k: usize| {
        let (sin, cos) = libm::sincos(k as f64 / n as f64 * FRAC_PI_2);
        let inset = DVec2::splat(radius_m * (1.0 - cos));
        let outline =
            outline::rounded_rectangle(half.truncate() - inset, radius_m * cos.max(0.1), n);
        let z = side * (half.z - radius_m + radius_m * sin);
        outline.iter().map(|p| centre + p.extend(z)).collect::<Vec<_>>()
    };
    let lower = (0..=n).rev().map(|k| section(-1.0, k));
    let upper = (0..=n).map(|k| section(1.0, k));
    let sections: Vec<_> = lower.chain(upper).collect();
    loft(b, &sections);
}
