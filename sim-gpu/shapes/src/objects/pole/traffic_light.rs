//! Traffic lights for vehicles, bicycles and persons.
//!
//! Lenses are 0.2 or 0.3 m wide (EN 12368), so that a head with three lenses is 0.7 to 1.1 m high.
//! Heads are at least 2.1 m up beside the road and at least 4.5 m up over it.

use std::f64::consts::PI;

use super::shaft;
use crate::primitives::*;

pub const MAKES: Makes = &[(4, mast), (2, gantry), (2, pedestrian)];

/// A head with `n` lenses that faces +x, with its middle at `centre`.
fn head(b: &mut Builder, s: &mut Sampler, centre: DVec3, n: usize, lens_m: f64) {
    let pitch_m = 1.12 * lens_m;
    let size = dvec3(s.uniform(0.12, 0.25), 1.25 * lens_m, pitch_m * n as f64 + 0.03);
    cushion(b, centre, size, 0.03);
    for lens in 0..n {
        let z = (lens as f64 - 0.5 * (n - 1) as f64) * pitch_m;
        visor(b, centre + dvec3(0.5 * size.x, 0.0, z), 0.5 * lens_m);
    }
    if s.chance(0.3) {
        block(b, centre, (size + dvec3(0.0, 0.3, 0.3)).with_x(0.01));
    }
}

/// The upper half of a tube over a lens.
fn visor(b: &mut Builder, lens: DVec3, radius_m: f64) {
    sheet(b, [PI * radius_m, radius_m], |u, v| {
        let (sin, cos) = libm::sincos(PI * (1.2 * u - 0.1));
        lens + dvec3(1.2 * v * radius_m, radius_m * cos, radius_m * sin)
    });
}

/// A mast beside the road with one or two heads.
fn mast(b: &mut Builder, s: &mut Sampler) {
    let lens_m = s.pick(&[0.2, 0.2, 0.3]);
    let radius_m = s.uniform(0.05, 0.1);
    let middle_m = s.uniform(2.1, 2.7) + 1.7 * lens_m;
    shaft(b, [radius_m, radius_m], middle_m + 2.2 * lens_m, Section::Round);
    // The heads are in front of the mast or at the ends of brackets on either side.
    let wide_m = s.uniform(0.25, 0.5);
    let places = [vec![0.0], vec![wide_m], vec![-wide_m, wide_m], vec![0.0, wide_m]];
    for y in s.pick(&places) {
        let n = s.pick(&[2, 3, 3, 3, 4]);
        let out = dvec3(radius_m + 0.13, y, middle_m);
        rod(b, middle_m * DVec3::Z, out, [0.03, 0.03]);
        let turn = DAffine3::from_rotation_z(s.pick(&[0.0, 0.0, 0.4, 1.6]));
        b.turned(out, turn, |b| head(b, s, DVec3::ZERO, n, lens_m));
    }
    if s.chance(0.2) {
        let panel = dvec3(0.02, s.uniform(0.4, 1.6), s.uniform(0.25, 0.6));
        block(b, dvec3(radius_m, 0.0, middle_m - 2.6 * lens_m), panel);
    }
    if s.chance(0.6) {
        push_button(b, radius_m);
    }
    if s.chance(0.3) {
        let cabinet = dvec3(0.3, 0.35, s.uniform(0.5, 1.2));
        block(b, dvec3(-0.25, 0.0, 0.5 * cabinet.z), cabinet);
    }
}

/// The push button for pedestrians, at the height of a hand.
fn push_button(b: &mut Builder, radius_m: f64) {
    block(b, dvec3(radius_m + 0.05, 0.0, 1.0), dvec3(0.1, 0.12, 0.25));
}

/// A tall mast with an arm over the road.
fn gantry(b: &mut Builder, s: &mut Sampler) {
    let radius_m = s.uniform(0.08, 0.16);
    let arm_m = s.uniform(5.2, 6.5);
    let reach_m = s.uniform(2.5, 6.0);
    shaft(b, [radius_m, 0.8 * radius_m], arm_m + 0.3, Section::Round);
    let end = dvec3(0.0, reach_m, arm_m + s.uniform(0.0, 0.4));
    rod(b, arm_m * DVec3::Z, end, [0.7 * radius_m, 0.4 * radius_m]);
    head(b, s, end + dvec3(0.15, -0.2, -0.2), 3, 0.3);
    if s.chance(0.6) {
        let lens_m = s.pick(&[0.2, 0.3]);
        head(b, s, dvec3(radius_m + 0.15, 0.0, 2.8), 3, lens_m);
    }
}

/// A light for pedestrians, with two lenses.
fn pedestrian(b: &mut Builder, s: &mut Sampler) {
    let radius_m = s.uniform(0.04, 0.08);
    let z = s.uniform(2.2, 2.6);
    shaft(b, [radius_m, radius_m], z + 0.35, Section::Round);
    let lens_m = s.pick(&[0.2, 0.3]);
    head(b, s, dvec3(radius_m + 0.12, 0.0, z), 2, lens_m);
    if s.chance(0.7) {
        push_button(b, radius_m);
    }
}
