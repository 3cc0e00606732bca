use std::f64::consts::TAU;

use super::foliage::{Clump, blade, fill, leaf, leaf_length_m};
use super::uneven::{Lump, Ripple, direction};
use super::wood::{Branch, Stem};
use crate::primitives::{Builder, DAffine3, DVec3, Makes, Sampler, dvec2, dvec3};

pub const MAKES: Makes =
    &[(5, loose), (6, trimmed), (2, thicket), (1, bare), (1, grass), (1, standard)];

/// Clumps of leaves about a common root, with a ragged outline.
fn loose(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.log_uniform(0.6, 2.5);
    let reach_m = (height_m * s.uniform(0.35, 0.9)).max(0.3);
    let deep_m = reach_m * s.uniform(0.7, 1.0);
    clumps(b, s, dvec3(reach_m, deep_m, height_m));
}

/// Several bushes that have grown together.
fn thicket(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.6, 2.3);
    let half_m = dvec2(s.uniform(1.0, 2.2), s.uniform(0.4, 1.2));
    clumps(b, s, half_m.extend(height_m));
}

/// Fills half of an ellipsoid on the ground with clumps, and joins the clumps to the ground by
/// twigs. `size_m` is the half width, the half depth and the height.
fn clumps(b: &mut Builder, s: &mut Sampler, size_m: DVec3) {
    let n = s.count(5, 16);
    let clump_m = libm::cbrt(size_m.element_product()) * s.uniform(1.0, 1.5) / libm::cbrt(n as f64);
    let ragged = s.uniform(0.1, 0.6);
    let clump = |_| {
        let out = libm::cbrt(s.uniform(0.0, 1.0)) * s.uniform(1.0 - ragged, 1.0);
        let place = direction(s);
        let radii_m = clump_m * s.uniform(0.5, 1.0) * dvec3(1.0, 1.0, s.uniform(0.6, 1.2));
        let inner_m = (size_m - radii_m).max(0.3 * size_m);
        let at = out * place.with_z(place.z.abs()) * inner_m;
        Clump { centre: at.with_z(at.z.max(0.4 * radii_m.z)), radii_m }
    };
    let clumps: Vec<_> = (0..n).map(clump).collect();
    for clump in &clumps {
        blade(b, 0.15 * clump.centre.with_z(0.0), clump.centre, 0.04);
    }
    let layers = s.uniform(0.8, 2.5);
    fill(b, s, &clumps, 1400, layers);
}

/// A body cut round: a ball, a dome or a cushion, with short leaves.
fn trimmed(b: &mut Builder, s: &mut Sampler) {
    // The height that a gardener reaches with shears.
    let height_m = s.uniform(0.4, 2.6);
    let half_m = (height_m * s.uniform(0.4, 1.1)).clamp(0.22, 1.9);
    let depth_m = half_m * s.uniform(0.75, 1.0);
    // The middle of a dome is near the ground, that of a ball at half its height.
    let middle_m = height_m * s.uniform(0.1, 0.6);
    let rough_m = s.uniform(0.005, 0.05) * half_m;
    let body = Lump {
        centre: middle_m * DVec3::Z,
        radii_m: dvec3(half_m, depth_m, height_m - middle_m),
        exponent: s.pick(&[2.0, 2.0, 2.0, 2.5, 4.0]),
        ripple: Ripple::draw(s, half_m * 0.7, rough_m),
    };
    if s.chance(0.4) {
        // Fine leaves fill the whole body, so that beams enter it.
        let clump = Clump { centre: body.centre, radii_m: body.radii_m };
        let layers = s.uniform(1.0, 3.0);
        return fill(b, s, &[clump], 1800, layers);
    }
    coated(b, s, &body);
}

/// Adds `body`, or a smaller core of it, and leaves in its surface above the ground.
fn coated(b: &mut Builder, s: &mut Sampler, body: &Lump) {
    let heart = s.pick(&[1.0, 0.9, 0.75]);
    b.place(DAffine3::from_scale(dvec3(heart, heart, 1.0)), |b| body.build(b));
    let deep = 1.2 * (1.0 - heart);
    let high_m = body.radii_m.z + body.centre.z.min(body.radii_m.z);
    let area_m2 = TAU * body.radii_m.x * high_m;
    let length_m = leaf_length_m(900, area_m2, s.uniform(0.2, 0.6) + deep).min(0.2);
    for _ in 0..900 {
        let at = body.at(direction(s));
        let at = at.lerp(body.centre, deep * s.uniform(0.0, 1.0));
        if at.z > 0.5 * length_m {
            leaf(b, s, at, length_m);
        }
    }
}

fn bare(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.6, 2.2);
    for _ in 0..s.count(6, 14) {
        let lean = s.uniform(0.1, 0.9) * direction(s).with_z(0.0);
        let along = 0.55 * height_m * (DVec3::Z + lean).normalize();
        let from = 0.08 * height_m * direction(s).with_z(0.0);
        Branch { from, along, radius_m: s.uniform(0.008, 0.025) }.grow(b, s, 2);
    }
}

/// A tuft of tall grass, reeds or flowers.
fn grass(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.4, 1.8);
    let half_m = (height_m * s.uniform(0.1, 0.5)).max(0.16);
    let spread = s.uniform(0.1, 0.7);
    for _ in 0..500 {
        let out = direction(s).with_z(0.0);
        let top = half_m * out + spread * height_m * out * s.uniform(0.0, 1.0);
        let high_m = height_m * s.uniform(0.4, 1.0);
        blade(b, half_m * out, top.with_z(high_m), 0.025);
    }
}

/// A ball on a stem.
fn standard(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.0, 2.5);
    let half_m = s.uniform(0.2, 0.5);
    let middle = (height_m - half_m) * DVec3::Z;
    Stem::draw(s, DVec3::ZERO, middle, [0.03, 0.02]).build(b);
    let ripple = Ripple::draw(s, half_m, 0.04 * half_m);
    coated(b, s, &Lump { centre: middle, radii_m: DVec3::splat(half_m), exponent: 2.0, ripple });
}
