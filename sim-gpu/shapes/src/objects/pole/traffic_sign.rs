//! Traffic signs on one or two posts.
//!
//! Sizes are those of Germany's VwV-StVO (circles 0.42, 0.6 and 0.75 m, triangles 0.63, 0.9 and
//! 1.26 m, squares 0.42, 0.6 and 0.84 m) and of the MUTCD of 2009 (octagons 0.75 and 0.9 m, speed
//! limits 0.6 by 0.75 m). The lower edge is 1.5 m (MUTCD, rural) to 2.3 m up (over footways);
//! panels that mark obstacles hang lower.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{draw_section, shaft};
use crate::primitives::*;

pub const MAKES: Makes = &[(6, single), (3, board), (2, low_panel), (1, street_name), (2, stele)];

/// Adds a plate across x with its middle at `centre`. The axes of `outline` point up and to the
/// left.
fn plate(b: &mut Builder, outline: &[DVec2], centre: DVec3, thick_m: f64) {
    b.turned(centre, DAffine3::from_rotation_y(-FRAC_PI_2), |b| {
        prism(b, outline, -0.5 * thick_m, 0.5 * thick_m, 1.0);
    });
}

/// Draws the outline of a sign. Its axes point up and to the left.
fn draw_outline(s: &mut Sampler) -> Vec<DVec2> {
    let corners = |n: usize, radius_m: f64, turn_rad: f64| {
        let at = |k: usize| DVec2::from_angle(turn_rad + k as f64 / n as f64 * TAU);
        (0..n).map(|k| radius_m * at(k)).collect::<Vec<_>>()
    };
    let circle_m = s.pick(&[0.42, 0.6, 0.6, 0.75]);
    let side_m = s.pick(&[0.63, 0.9, 0.9, 1.26]);
    let square_m = s.pick(&[0.42, 0.6, 0.6, 0.75, 0.84]);
    let octagon_m = s.pick(&[0.75, 0.9]);
    // The distance of a triangle's corners from its middle is its side over the root of 3.
    let apex_m = side_m / 3_f64.sqrt();
    match s.count(0, 6) {
        0 | 1 => corners(20, 0.5 * circle_m, 0.0),
        2 => corners(3, apex_m, s.pick(&[0.0, 0.5 * TAU])),
        3 => corners(8, 0.54 * octagon_m, TAU / 16.0),
        4 => corners(4, square_m * 0.5_f64.sqrt(), s.pick(&[0.0, TAU / 8.0])),
        _ => outline::rectangle(dvec2(s.uniform(0.6, 1.2), square_m) / 2.0),
    }
}

/// A post with one sign or several signs above each other, sometimes on both sides.
fn single(b: &mut Builder, s: &mut Sampler) {
    let low_m = s.uniform(1.5, 2.3);
    let radius_m = s.uniform(0.025, 0.045);
    let section = draw_section(s);
    let back_to_back = s.chance(0.15);
    // Some signs are mounted to one side of their post, like flags.
    let flag = if s.chance(0.25) { s.pick(&[-0.9, 0.9]) } else { 0.0 };
    let mut z = low_m;
    for number in 0..s.weighted(&[(6, 1), (3, 2), (1, 3)]) {
        // Signs below the first are often plain rectangles.
        let tablet = number > 0 && s.chance(0.6);
        let high_m = s.uniform(0.2, 0.42);
        let outline = if tablet {
            outline::rectangle(dvec2(high_m, s.uniform(0.42, 0.6)) / 2.0)
        } else {
            draw_outline(s)
        };
        let below_m = outline.iter().map(|p| -p.x).fold(0.0, f64::max);
        let above_m = outline.iter().map(|p| p.x).fold(0.0, f64::max);
        z += below_m;
        let y = flag * outline.iter().map(|p| p.y).fold(0.0, f64::max);
        for side in if back_to_back { vec![1.0, -1.0] } else { vec![1.0] } {
            plate(b, &outline, dvec3(side * (radius_m + 0.015), y, z), 0.01);
        }
        z += above_m + 0.03;
    }
    shaft(b, [radius_m, radius_m], z + s.uniform(-0.03, 0.3), section);
}

/// A large direction board on two posts.
fn board(b: &mut Builder, s: &mut Sampler) {
    let wide_m = s.log_uniform(1.0, 4.5);
    let high_m = wide_m * s.uniform(0.25, 0.8);
    let low_m = s.uniform(1.0, 2.3);
    let post_m = s.uniform(0.03, 0.08);
    let panel = dvec3(s.uniform(0.01, 0.06), wide_m, high_m);
    block(b, dvec3(post_m + 0.5 * panel.x, 0.0, low_m + 0.5 * high_m), panel);
    let y = 0.5 * wide_m * s.uniform(0.5, 0.9);
    for side in [-1.0, 1.0] {
        b.shifted(side * y * DVec3::Y, |b| {
            shaft(b, [post_m, post_m], low_m + high_m, Section::Round);
        });
    }
}

/// A panel at the height of a car: a chevron, an obstacle marker, or the beacon of a road work on
/// its foot.
fn low_panel(b: &mut Builder, s: &mut Sampler) {
    let size = dvec3(0.03, s.uniform(0.25, 0.6), s.uniform(0.5, 1.0));
    let top_m = s.uniform(1.25, 1.9);
    block(b, (top_m - 0.5 * size.z) * DVec3::Z + 0.05 * DVec3::X, size);
    shaft(b, [0.03, 0.03], top_m, draw_section(s));
    if s.chance(0.4) {
        block(b, 0.06 * DVec3::Z, dvec3(0.8, 0.4, 0.12));
    }
}

/// One or two street name signs, at right angles.
fn street_name(b: &mut Builder, s: &mut Sampler) {
    let z = s.uniform(2.2, 3.0);
    let size = dvec3(0.02, s.uniform(0.6, 1.1), s.uniform(0.15, 0.25));
    shaft(b, [0.03, 0.03], z, draw_section(s));
    block(b, (z + 0.5 * size.z) * DVec3::Z, size);
    if s.chance(0.7) {
        block(b, (z + 1.5 * size.z) * DVec3::Z, dvec3(size.y, size.x, size.z));
    }
}

/// A narrow board on the ground or on a low foot, about as high as a person: a town map, a price
/// board, a shop board.
fn stele(b: &mut Builder, s: &mut Sampler) {
    let size = dvec3(s.log_uniform(0.03, 0.3), s.log_uniform(0.3, 1.2), s.uniform(1.25, 2.4));
    let low_m = s.pick(&[0.0, 0.0, 0.3, 0.7]);
    block(b, (low_m + 0.5 * size.z) * DVec3::Z, size);
    if low_m > 0.0 {
        let y = s.uniform(0.0, 0.45) * size.y;
        for side in [-1.0, 1.0] {
            b.shifted(side * y * DVec3::Y, |b| shaft(b, [0.04, 0.04], low_m, Section::Round));
        }
    }
}
