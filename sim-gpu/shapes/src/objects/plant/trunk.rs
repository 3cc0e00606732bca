//! Trunks, cut off where the crown begins.

use std::f64::consts::TAU;

use super::foliage::{blade, leaf};
use super::uneven::direction;
use super::wood::{Stem, bough};
use crate::primitives::{Builder, DVec3, Sampler, dvec3};

pub fn build(b: &mut Builder, s: &mut Sampler) {
    let radius_m = s.log_uniform(0.05, 0.5);
    let height_m = s.uniform(2.0, 4.0);
    let fork_m = if s.chance(0.25) { s.uniform(0.6, 1.8) } else { height_m };
    let lean = s.uniform(0.0, 0.12) * fork_m * direction(s).with_z(0.0);
    let top = lean + fork_m * DVec3::Z;
    let top_radius_m = s.uniform(0.75, 0.95) * radius_m;
    let stem = Stem::draw(s, DVec3::ZERO, top, [radius_m, top_radius_m]);
    stem.build(b);
    if fork_m < height_m {
        fork(b, s, top, radius_m, height_m - fork_m);
    }
    for _ in 0..s.pick(&[0, 0, 0, 1, 2, 4]) {
        let from = stem.at(s.uniform(0.4, 1.0));
        let out = direction(s) + 0.8 * DVec3::Z;
        bough(b, from, from + s.uniform(0.2, 1.0) * out, 0.3 * radius_m, 0.05);
    }
    if s.chance(0.2) {
        ivy(b, s, &stem);
    }
    if s.chance(0.2) {
        shoots(b, s, radius_m);
    }
}

/// Two or three limbs at a fork.
fn fork(b: &mut Builder, s: &mut Sampler, from: DVec3, radius_m: f64, rise_m: f64) {
    let n = s.count(2, 3);
    let turn_rad = s.uniform(0.0, TAU);
    for limb in 0..n {
        let (sin, cos) = libm::sincos(turn_rad + limb as f64 / n as f64 * TAU);
        let apart = rise_m * s.uniform(0.12, 0.5) * dvec3(cos, sin, 0.0);
        let foot = from - 0.4 * radius_m * DVec3::Z;
        let thick_m = radius_m * s.uniform(0.5, 0.8);
        Stem::draw(s, foot, from + apart + rise_m * DVec3::Z, [thick_m, 0.8 * thick_m]).build(b);
    }
}

/// Ivy on the lower part of a stem.
fn ivy(b: &mut Builder, s: &mut Sampler, stem: &Stem) {
    let reach = s.uniform(0.3, 1.0);
    for _ in 0..500 {
        let share = reach * s.uniform(0.0, 1.0);
        let at = stem.bark(share, s.uniform(0.0, TAU));
        let out = (at - stem.at(share)).normalize_or(DVec3::X);
        let at = at + s.uniform(0.0, 0.12) * out;
        leaf(b, s, at, 0.1);
    }
}

/// Thin shoots and tall grass around the foot.
fn shoots(b: &mut Builder, s: &mut Sampler, radius_m: f64) {
    for _ in 0..80 {
        let (sin, cos) = libm::sincos(s.uniform(0.0, TAU));
        let foot = radius_m * s.uniform(1.0, 1.6) * dvec3(cos, sin, 0.0);
        let top = foot + s.uniform(0.1, 0.5) * (DVec3::Z + 0.4 * direction(s));
        blade(b, foot, top.with_z(top.z.max(0.05)), 0.02);
    }
}
