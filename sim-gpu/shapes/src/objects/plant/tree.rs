//! Trees with their crowns.
//!
//! Street trees have 2 to 4.5 m of clear stem over ways (Germany's FLL advice, the British BS
//! 8545); garden trees branch from the ground.

use std::f64::consts::TAU;

use super::foliage::{Clump, fill, leaf, leaf_length_m};
use super::uneven::{Lump, Ripple, direction};
use super::wood::{Branch, Stem, bough};
use crate::primitives::{Builder, DVec2, DVec3, Makes, Sampler, dvec3};

pub const MAKES: Makes = &[(6, broadleaved), (2, conifer), (2, bare), (1, column), (1, palm)];

struct Form {
    height_m: f64,
    /// The height of the crown's lower end.
    crown_m: f64,
    /// Half the crown's width.
    reach_m: f64,
    stem_m: f64,
}

impl Form {
    fn draw(s: &mut Sampler) -> Self {
        let low = s.chance(0.25);
        let height_m = if low { s.uniform(2.3, 6.0) } else { s.log_uniform(3.2, 14.0) };
        let crown_m = if low { s.uniform(0.1, 0.8) } else { s.uniform(1.4, 3.0) };
        let crown_m = crown_m.min(0.55 * height_m);
        let reach_m = (0.5 * (height_m - crown_m) * s.uniform(0.6, 1.5)).clamp(0.6, 5.0);
        Self { height_m, crown_m, reach_m, stem_m: height_m * s.uniform(0.01, 0.028) }
    }

    fn crown(&self) -> (DVec3, DVec3) {
        let half_m = 0.5 * (self.height_m - self.crown_m);
        let radii_m = dvec3(self.reach_m, self.reach_m, half_m);
        ((self.crown_m + half_m) * DVec3::Z, radii_m)
    }

    /// Builds one or several stems that reach into the crown.
    fn stems(&self, b: &mut Builder, s: &mut Sampler) -> Vec<Stem> {
        let n = s.weighted(&[(6, 1), (1, 2), (1, 3)]);
        let thick_m = self.stem_m.max(0.03) / (n as f64).sqrt();
        let high_m = self.crown_m + 0.6 * (self.height_m - self.crown_m);
        let stem = |i: usize| {
            let apart = DVec2::from_angle(i as f64 / n as f64 * TAU).extend(0.0);
            let apart = if n > 1 { apart } else { DVec3::ZERO };
            let lean = s.uniform(0.0, 0.06) * high_m * direction(s).with_z(0.0);
            let top = 0.3 * self.reach_m * apart + lean + high_m * DVec3::Z;
            Stem::draw(s, 1.2 * thick_m * apart, top, [thick_m, 0.35 * thick_m])
        };
        let stems: Vec<_> = (0..n).map(stem).collect();
        stems.iter().for_each(|stem| stem.build(b));
        stems
    }
}

/// A crown of clumps of leaves, each at the end of a branch.
fn broadleaved(b: &mut Builder, s: &mut Sampler) {
    let form = Form::draw(s);
    let stems = form.stems(b, s);
    let (middle, crown_m) = form.crown();
    let n = s.count(7, 22);
    let size = s.uniform(0.75, 1.1) / libm::cbrt(n as f64);
    let clump = |_| {
        let out = libm::cbrt(s.uniform(0.1, 1.0)) * (1.0 - 0.6 * size);
        let flat = dvec3(1.0, 1.0, s.uniform(0.6, 1.0));
        let radii_m = size * s.uniform(0.7, 1.3) * crown_m * flat;
        Clump { centre: middle + out * direction(s) * crown_m, radii_m }
    };
    let clumps: Vec<_> = (0..n).map(clump).collect();
    for clump in &clumps {
        let stem = s.pick(&stems.iter().collect::<Vec<_>>());
        let share = stem.share_at(s.uniform(0.5, 0.9) * clump.centre.z).max(0.3);
        let radius_m = (form.stem_m * s.uniform(0.2, 0.5)).clamp(0.015, 0.15);
        bough(b, stem.at(share), clump.centre, radius_m, s.uniform(-0.1, 0.1));
    }
    let layers = s.uniform(0.7, 2.2);
    fill(b, s, &clumps, 3600, layers);
}

/// Whorls of branches that shorten towards the top.
fn conifer(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.log_uniform(2.3, 13.0);
    let clear = s.chance(0.3);
    let crown_m = (if clear { 0.35 } else { s.uniform(0.02, 0.12) }) * height_m;
    let reach_m = (height_m * s.uniform(0.13, 0.3)).max(0.5);
    let radius_m = height_m * s.uniform(0.008, 0.02);
    Stem::draw(s, DVec3::ZERO, 0.97 * height_m * DVec3::Z, [radius_m, 0.01]).build(b);
    let droop = s.uniform(-0.4, 0.3);
    let n_whorls = s.count(8, 16);
    let mut clumps = Vec::new();
    for whorl in 0..n_whorls {
        let share = (whorl as f64 + s.uniform(0.0, 0.5)) / n_whorls as f64;
        let z = crown_m + share * (height_m - crown_m);
        let n = s.count(5, 7);
        for branch in 0..n {
            let length_m = (reach_m * (1.0 - share) * s.uniform(0.7, 1.1)).max(0.08);
            let turn_rad = (branch as f64 + s.uniform(0.0, 1.0)) / n as f64 * TAU;
            let along = length_m * DVec2::from_angle(turn_rad).extend(droop);
            for part in [0.4, 0.8] {
                let radii_m = length_m * dvec3(0.3, 0.3, 0.16);
                clumps.push(Clump { centre: z * DVec3::Z + part * along, radii_m });
            }
        }
    }
    let layers = s.uniform(0.7, 1.8);
    fill(b, s, &clumps, 4200, layers);
}

fn bare(b: &mut Builder, s: &mut Sampler) {
    let form = Form::draw(s);
    let stems = form.stems(b, s);
    for limb in 0..10 {
        let stem = &stems[limb % stems.len()];
        let share = s.uniform(0.45, 1.0);
        let from = stem.at(share);
        // The golden angle, about 2.4 rad, separates successive shoots.
        let turn_rad = (limb as f64 + s.uniform(0.0, 0.7)) * 2.4;
        let out = DVec2::from_angle(turn_rad).extend(s.uniform(0.2, 1.2)).normalize();
        let length_m = 0.55 * form.reach_m.max(0.3 * (form.height_m - from.z));
        let radius_m = 0.55 * stem.radius_m(share);
        Branch { from, along: length_m * out, radius_m }.grow(b, s, 3);
    }
}

/// A cypress or thuja: a narrow, dense body.
fn column(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.log_uniform(2.1, 8.0);
    let half_m = (height_m * s.uniform(0.07, 0.2)).max(0.42);
    let rough_m = s.uniform(0.02, 0.08) * half_m;
    let ripple = Ripple::draw(s, half_m, rough_m);
    let radii_m = dvec3(half_m, half_m, 0.5 * height_m);
    let body = Lump { centre: 0.5 * height_m * DVec3::Z, radii_m, exponent: 2.0, ripple };
    body.build(b);
    let length_m = leaf_length_m(1500, TAU * half_m * height_m, s.uniform(0.2, 0.5));
    for _ in 0..1500 {
        let out = direction(s);
        // The cube puts more points on the long side than at the ends.
        let out = dvec3(out.x, out.y, out.z.powi(3)).normalize_or(DVec3::X);
        leaf(b, s, body.at(out) * dvec3(1.03, 1.03, 1.0), length_m);
    }
}

/// A bare stem with fronds at its top.
fn palm(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(2.0, 9.0);
    let radius_m = s.uniform(0.1, 0.25);
    let lean = s.uniform(0.0, 0.1) * height_m * direction(s).with_z(0.0);
    let top = lean + height_m * DVec3::Z;
    Stem::draw(s, DVec3::ZERO, top, [radius_m, 0.8 * radius_m]).build(b);
    let reach_m = s.uniform(1.0, 2.4);
    for frond in 0..s.count(14, 30) {
        let out = DVec2::from_angle(frond as f64 * 2.4).extend(0.0);
        let rise = s.uniform(-0.4, 1.0);
        let half = 0.12 * reach_m * out.cross(DVec3::Z);
        let at = |share: f64| {
            let z = rise * share - 0.9 * share * share;
            top + reach_m * (share * out + z * DVec3::Z)
        };
        let row = |share: f64, wide: f64| {
            vec![at(share) - wide * half - 0.4 * wide * half.length() * DVec3::Z, at(share)]
        };
        let widths = [(0.0, 0.1), (0.25, 1.0), (0.5, 1.1), (0.75, 0.8), (1.0, 0.1)];
        let left: Vec<_> = widths.iter().map(|&(share, wide)| row(share, wide)).collect();
        let right: Vec<_> = widths.iter().map(|&(share, wide)| row(share, -wide)).collect();
        b.grid(&left, false);
        b.grid(&right, false);
    }
}
