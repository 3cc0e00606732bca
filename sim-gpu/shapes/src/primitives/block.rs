//! Boxes, sharp or with rounded edges.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::super::builder::Builder;
use super::loft::{Caps, loft};
use super::outline;

/// The box of `size` about `centre`; each face has vertices of its own.
pub fn block(b: &mut Builder, centre: DVec3, size: DVec3) {
    let half = size / 2.0;
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            face(b, centre, half, axis, side);
        }
    }
}

/// The box between two opposite corners.
pub fn block_between(b: &mut Builder, low: DVec3, high: DVec3) {
    block(b, (low + high) / 2.0, (high - low).abs());
}

/// The face of a box that looks along `axis` (0..3), to its `side`.
fn face(b: &mut Builder, centre: DVec3, half: DVec3, axis: usize, side: f64) {
    let unit = |index: usize| DVec3::AXES[index % 3] * half[index % 3];
    let (normal, u, v) = (unit(axis) * side, unit(axis + 1) * side, unit(axis + 2));
    let [n_u, n_v] = [u, v].map(|edge| b.straight(2.0 * edge.length()));
    let at = |k: usize, n: usize| 2.0 * k as f64 / n as f64 - 1.0;
    let rows: Vec<Vec<DVec3>> = (0..=n_v)
        .map(|j| (0..=n_u).map(|i| centre + normal + at(i, n_u) * u + at(j, n_v) * v).collect())
        .collect();
    b.grid(&rows, false);
}

/// The box of `size` about `centre` with all edges rounded by `radius_m`, cut
/// to what fits: a cushion, a casing.
pub fn cushion(b: &mut Builder, centre: DVec3, size: DVec3, radius_m: f64) {
    let half = size / 2.0;
    let radius_m = radius_m.min(0.999 * half.min_element());
    let n = b.curved(radius_m * FRAC_PI_2, 2);
    let section = |side: f64, k: usize| {
        let (sin, cos) = (k as f64 / n as f64 * FRAC_PI_2).sin_cos();
        let inset = DVec2::splat(radius_m * (1.0 - cos));
        let outline =
            outline::rounded_rectangle(half.truncate() - inset, radius_m * cos.max(0.1), n);
        let z = side * (half.z - radius_m + radius_m * sin);
        outline.iter().map(|p| centre + p.extend(z)).collect::<Vec<_>>()
    };
    let lower = (0..=n).rev().map(|k| section(-1.0, k));
    let upper = (0..=n).map(|k| section(1.0, k));
    let sections: Vec<_> = lower.chain(upper).collect();
    loft(b, &sections, Caps::BOTH);
}

#[cfg(test)]
mod tests {
    use super::super::measure::{area_m2, volume_m3};
    use super::*;

    #[test]
    fn a_block_encloses_its_volume_however_finely_divided() {
        let size = DVec3::new(1.0, 2.0, 3.0);
        for edge_m in [f64::INFINITY, 0.3] {
            // Sums of some hundred terms below 1, rounded at 1e-16 each.
            let volume = volume_m3(edge_m, |b| block(b, DVec3::ONE, size));
            assert!((volume - 6.0).abs() < 1e-12, "{volume}");
            assert!((area_m2(edge_m, |b| block(b, DVec3::ONE, size)) - 22.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cushion_lacks_only_its_rounded_edges() {
        let volume = volume_m3(0.05, |b| cushion(b, DVec3::ZERO, DVec3::splat(2.0), 0.1));
        // Twelve edges of length 2 lose (1 - pi / 4) 0.1^2 a metre: 0.0515.
        assert!((7.93..7.97).contains(&volume), "{volume}");
    }
}
