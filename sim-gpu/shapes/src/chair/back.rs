use std::f64::consts::{PI, TAU};

use super::Seat;
use crate::primitives::*;

/// The size of a back. In its frame x is across, y to the rear, and z up along the back from the
/// rear edge of the seat.
#[derive(Clone, Copy)]
struct Back {
    half_m: f64,
    high_m: f64,
}

const MAKES: [fn(&mut Builder, &mut Sampler, Back); 13] = [
    panel, panel, padded, shell, shell, slats, slats, ladder, ladder, railed, hooped, medallion,
    headrest,
];

pub fn build(b: &mut Builder, s: &mut Sampler, seat: &Seat) {
    let low = s.chance(0.15);
    let high_m = if low { s.uniform(0.16, 0.3) } else { s.uniform(0.34, 0.68) };
    let back = Back { half_m: seat.side_m(seat.rear_m()) * s.uniform(0.86, 1.04), high_m };
    let lean_rad = s.uniform(0.02, 0.32);
    let foot = dvec3(0.0, seat.rear_m(), seat.top_m - 0.6 * seat.thick_m);
    b.turned(foot, DAffine3::from_rotation_x(-lean_rad), |b| s.pick(&MAKES)(b, s, back));
}

/// Two posts with a board or a net between them.
fn panel(b: &mut Builder, s: &mut Sampler, back: Back) {
    let gap_m = back.high_m * s.pick(&[0.0, 0.25, 0.45]);
    let thick_m = s.uniform(0.012, 0.04);
    posts(b, back, 0.5 * thick_m);
    let size = dvec3(2.0 * back.half_m, thick_m, back.high_m - gap_m);
    block(b, dvec3(0.0, 0.0, 0.5 * (back.high_m + gap_m)), size);
}

fn posts(b: &mut Builder, back: Back, r: f64) {
    let x = back.half_m - r;
    b.mirrored_x(|b| rod(b, x * DVec3::X, dvec3(x, 0.0, back.high_m), [r, r]));
}

/// A thick cushion in front of two short posts.
fn padded(b: &mut Builder, s: &mut Sampler, back: Back) {
    let thick_m = s.uniform(0.05, 0.12);
    let gap_m = s.pick(&[0.0, 0.08]);
    let size = dvec3(2.0 * back.half_m, thick_m, back.high_m - gap_m);
    posts(b, Back { half_m: 0.5 * back.half_m, high_m: 0.6 * back.high_m }, 0.012);
    cushion(b, dvec3(0.0, 0.0, 0.5 * (back.high_m + gap_m)), size, 0.4 * thick_m);
}

/// A shell that curves around the sitter and is rounded above; a board or a sheet.
fn shell(b: &mut Builder, s: &mut Sampler, back: Back) {
    let wrap_m = back.half_m * s.uniform(0.15, 0.7);
    let round = s.uniform(0.0, 0.5);
    let thin = s.chance(0.4);
    let at = move |u: f64, v: f64| {
        let across = 2.0 * u - 1.0;
        let narrowing = 1.0 - round * v.powi(4);
        let y = 0.02 - wrap_m * across * across * (1.0 - 0.4 * v);
        dvec3(across * back.half_m * narrowing, y, v * back.high_m)
    };
    let size_m = [2.2 * back.half_m, back.high_m];
    if thin {
        sheet(b, size_m, at);
    } else {
        board(b, size_m, 0.02 * DVec3::Y, at);
    }
}

/// Upright slats between two rails and two posts.
fn slats(b: &mut Builder, s: &mut Sampler, back: Back) {
    let r = s.uniform(0.012, 0.022);
    let n = s.count(2, 6);
    let rail_m = s.uniform(0.03, 0.08);
    let low_m = back.high_m * s.uniform(0.1, 0.35);
    posts(b, back, r);
    for z in [low_m, back.high_m - 0.5 * rail_m] {
        block(b, z * DVec3::Z, dvec3(2.0 * back.half_m, 1.4 * r, rail_m));
    }
    let wide_m = 2.0 * back.half_m / (n + 1) as f64 * s.uniform(0.25, 0.6);
    for slat in 0..n {
        let x = back.half_m * (2.0 * (slat + 1) as f64 / (n + 1) as f64 - 1.0);
        block(b, dvec3(x, 0.0, 0.5 * (low_m + back.high_m)), dvec3(wide_m, r, back.high_m - low_m));
    }
}

/// Level rungs, straight or bent, between two posts.
fn ladder(b: &mut Builder, s: &mut Sampler, back: Back) {
    let r = s.uniform(0.012, 0.022);
    let n = s.count(2, 5);
    let bend_m = back.half_m * s.pick(&[0.0, 0.12, 0.25]);
    let rung_m = back.high_m / (n + 1) as f64 * s.uniform(0.25, 0.7);
    posts(b, back, r);
    for rung in 1..=n {
        let z = back.high_m * (rung as f64 / n as f64) - 0.5 * rung_m;
        let size_m = [2.0 * back.half_m, rung_m];
        board(b, size_m, 0.6 * r * DVec3::Y, |u, v| {
            let across = 2.0 * u - 1.0;
            let y = bend_m * (1.0 - across * across);
            dvec3(across * (back.half_m - r), y, z + (v - 0.5) * rung_m)
        });
    }
}

/// Thin rods under a straight top rail.
fn railed(b: &mut Builder, s: &mut Sampler, back: Back) {
    let r = s.uniform(0.005, 0.01);
    spindles(b, s, r, back, |_| 1.0);
    block(b, back.high_m * DVec3::Z, dvec3(2.2 * back.half_m, 0.025, 0.07));
}

/// Thin rods within a hoop.
fn hooped(b: &mut Builder, s: &mut Sampler, back: Back) {
    let r = s.uniform(0.005, 0.01);
    spindles(b, s, r, back, |across| (1.0 - across * across).sqrt());
    let arch: Vec<_> = (0..=8)
        .map(|k| libm::sincos(k as f64 / 8.0 * PI))
        .map(|(sin, cos)| dvec3(cos * back.half_m, 0.0, sin * back.high_m))
        .collect();
    smooth_tube(b, &arch, 2, 1.8 * r);
}

/// Rods in a fan. `height` returns the height of a rod at its position across.
fn spindles(b: &mut Builder, s: &mut Sampler, r: f64, back: Back, height: impl Fn(f64) -> f64) {
    let n = s.count(5, 9);
    for spindle in 0..n {
        let across = 0.86 * (2.0 * spindle as f64 / (n - 1) as f64 - 1.0);
        let foot = dvec3(0.8 * across * back.half_m, 0.0, 0.0);
        rod(b, foot, dvec3(across * back.half_m, 0.0, height(across) * back.high_m), [r, r]);
    }
}

/// An oval cushion in a ring, on two short posts.
fn medallion(b: &mut Builder, s: &mut Sampler, back: Back) {
    let half = dvec2(0.9 * back.half_m, 0.38 * back.high_m);
    let middle_m = back.high_m - half.y;
    posts(b, Back { half_m: 0.45 * back.half_m, high_m: middle_m }, 0.012);
    let ring: Vec<_> = (0..=16)
        .map(|k| libm::sincos(k as f64 / 16.0 * TAU))
        .map(|(sin, cos)| dvec3(cos * half.x, 0.0, middle_m + sin * half.y))
        .collect();
    smooth_tube(b, &ring, 1, s.uniform(0.012, 0.025));
    ellipsoid(b, middle_m * DVec3::Z, dvec3(half.x, s.uniform(0.015, 0.05), half.y));
}

/// An office chair's back: a bent pad on a spine, a pad for the head above.
fn headrest(b: &mut Builder, s: &mut Sampler, back: Back) {
    let thick_m = s.uniform(0.02, 0.07);
    let spine = [(0.0, -0.05), (0.09, 0.1), (0.06, 0.6 * back.high_m)];
    let path = smooth(b, &spine.map(|(y, z)| dvec3(0.0, y, z)), 2);
    sweep(b, &path, &outline::rectangle(dvec2(0.04, 0.012)));
    let low_m = 0.12 * back.high_m;
    let size_m = [2.0 * back.half_m, back.high_m - low_m];
    board(b, size_m, thick_m * DVec3::Y, |u, v| {
        let across = 2.0 * u - 1.0;
        let y = 0.02 - 0.06 * across * across - 0.1 * (v - 0.35) * (v - 0.35);
        dvec3(across * back.half_m, y, low_m + v * size_m[1])
    });
    let head = dvec3(1.1 * back.half_m, 1.2 * thick_m, 0.12);
    rod(b, 0.9 * back.high_m * DVec3::Z, (back.high_m + 0.1) * DVec3::Z, [0.015, 0.015]);
    cushion(b, (back.high_m + 0.1) * DVec3::Z, head, 0.4 * thick_m);
}
