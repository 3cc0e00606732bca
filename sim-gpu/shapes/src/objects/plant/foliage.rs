use std::f64::consts::PI;

use super::uneven::direction;
use crate::primitives::{Builder, DVec3, Sampler};

/// The area of a leaf over the square of its length, which is half the width over the length.
const LEAF_AREA: f64 = 0.45;

/// An ellipsoid that leaves fill.
pub struct Clump {
    pub centre: DVec3,
    pub radii_m: DVec3,
}

impl Clump {
    /// The approximate mean area of the clump's silhouettes.
    fn silhouette_m2(&self) -> f64 {
        PI * libm::pow(self.radii_m.element_product(), 2.0 / 3.0)
    }
}

/// Adds a leaf, or a spray of small leaves, `length_m` long, above the ground.
pub fn leaf(b: &mut Builder, s: &mut Sampler, at: DVec3, length_m: f64) {
    let along = direction(s);
    let across = along.cross(direction(s)).normalize_or(along.any_orthonormal_vector());
    let long = length_m * s.uniform(0.7, 1.3) * along;
    let half = LEAF_AREA * length_m * across;
    let base = at - 0.5 * long;
    let above = |p: DVec3| p.with_z(p.z.max(0.0));
    b.grid(&[vec![above(base - half), above(base + half)], vec![above(base + long)]], false);
}

/// The length of `n` leaves if a beam through `area_m2` meets `layers` of them on average. A leaf
/// in a random orientation shows half of its area.
pub fn leaf_length_m(n: usize, area_m2: f64, layers: f64) -> f64 {
    (2.0 * layers * area_m2 / (LEAF_AREA * n as f64)).sqrt()
}

/// Fills `clumps` with `n` leaves. A beam through the middle of a clump meets about `layers` of
/// them.
///
/// Most leaves are near the surface of a clump, where the light is. The fraction of beams that pass
/// is about exp(-layers), the law of Beer and Lambert that Monsi and Saeki applied to foliage
/// (1953).
pub fn fill(b: &mut Builder, s: &mut Sampler, clumps: &[Clump], n: usize, layers: f64) {
    let area_m2: f64 = clumps.iter().map(Clump::silhouette_m2).sum();
    let length_m = leaf_length_m(n, area_m2, layers);
    for clump in clumps {
        let share = clump.silhouette_m2() / area_m2;
        for _ in 0..(share * n as f64).round() as usize {
            let out = libm::pow(s.uniform(0.0, 1.0), 0.22);
            let at = clump.centre + out * direction(s) * clump.radii_m;
            leaf(b, s, at.with_z(at.z.max(0.05)), length_m);
        }
    }
}

/// Adds a twig or a blade of grass: two crossed triangles, `width_m` wide at their foot.
///
/// A beam is about 3 mrad wide and therefore hits twigs that a line would miss: at 10 m, twigs are
/// built 3 cm thicker than real ones.
pub fn blade(b: &mut Builder, from: DVec3, to: DVec3, width_m: f64) {
    let along = (to - from).normalize_or(DVec3::Z);
    let across = along.any_orthonormal_vector();
    for across in [across, along.cross(across)] {
        let half = 0.5 * width_m * across;
        b.grid(&[vec![from - half, from + half], vec![to]], false);
    }
}
