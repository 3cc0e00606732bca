//! Lamp posts: columns of 3 to 10 m (EN 40-2) with one or two luminaires.

use super::shaft;
use crate::primitives::*;

pub const MAKES: Makes = &[(4, arm), (3, post_top), (2, lantern)];

/// A column that tapers upwards, sometimes with a wider foot.
fn column(b: &mut Builder, s: &mut Sampler, height_m: f64) {
    let radius_m = 0.03 + height_m * s.uniform(0.005, 0.01);
    let section = s.pick(&[Section::Round, Section::Round, Section::Polygon(8)]);
    if s.chance(0.5) {
        let foot_m = radius_m * s.uniform(1.3, 2.0);
        shaft(b, [foot_m, foot_m], s.uniform(0.5, 1.3), section);
    }
    shaft(b, [radius_m, 0.6 * radius_m], height_m, section);
}

/// One or two flat luminaires, each at the end of an arm.
fn arm(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(5.0, 10.0);
    let reach_m = s.uniform(0.3, 2.0);
    let rise_m = s.uniform(0.0, 0.8);
    column(b, s, height_m);
    let size = dvec3(s.uniform(0.4, 0.9), s.uniform(0.2, 0.4), s.uniform(0.08, 0.2));
    let curved = s.chance(0.5);
    let build = |b: &mut Builder| {
        let from = height_m * DVec3::Z;
        let to = from + dvec3(reach_m, 0.0, rise_m);
        if curved {
            smooth_tube(b, &[from, from + dvec3(0.25 * reach_m, 0.0, 0.85 * rise_m), to], 3, 0.04);
        } else {
            rod(b, from, to, [0.04, 0.03]);
        }
        cushion(b, to + 0.4 * size.x * DVec3::X, size, 0.03);
    };
    build(b);
    if s.chance(0.3) {
        b.place(DAffine3::from_rotation_z(std::f64::consts::PI), build);
    }
}

/// A globe, a disc, a hat or a drum on top of a column.
fn post_top(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(3.0, 5.5);
    column(b, s, height_m);
    let radius_m = s.uniform(0.15, 0.35);
    let top = height_m * DVec3::Z;
    match s.count(0, 3) {
        0 => ellipsoid(b, top + radius_m * DVec3::Z, DVec3::splat(radius_m)),
        1 => cylinder(b, top, radius_m, 0.12),
        2 => frustum(b, top, [0.5 * radius_m, radius_m], 0.35),
        _ => {
            cylinder(b, top, 0.5 * radius_m, 0.4);
            frustum(b, top + 0.4 * DVec3::Z, [1.2 * radius_m, 0.2 * radius_m], 0.15);
        }
    }
}

/// A cast column in the old style with a lantern of four or six sides.
fn lantern(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(2.8, 4.5);
    let foot_m = s.uniform(0.12, 0.25);
    let thin_m = s.uniform(0.035, 0.06);
    Profile::from(foot_m, 0.0)
        .line(foot_m, 0.25)
        .curve(&[(0.7 * foot_m, 0.4), (1.3 * thin_m, 0.9), (thin_m, 1.6), (thin_m, height_m)])
        .line(0.0, height_m)
        .revolve(b, Section::Round);
    let wide_m = s.uniform(0.15, 0.25);
    let section = Section::Polygon(s.pick(&[4, 6]));
    let lamp = Profile::from(0.6 * wide_m, 0.0)
        .line(wide_m, 0.5)
        .line(1.15 * wide_m, 0.52)
        .line(0.2 * wide_m, 0.7)
        .line(0.0, 0.8);
    b.shifted(height_m * DVec3::Z, |b| lamp.revolve(b, section));
    if s.chance(0.3) {
        block(b, 0.92 * height_m * DVec3::Z, dvec3(0.05, 0.8, 0.05));
    }
}
