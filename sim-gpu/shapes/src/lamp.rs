mod shade;

use std::f64::consts::{PI, TAU};

use crate::primitives::*;
use shade::shade;

pub const MAKES: Makes = &[
    (3, table_lamp),
    (1, floor_lamp),
    (1, tripod),
    (1, arc_lamp),
    (2, desk_lamp),
    (1, gooseneck),
    (1, pendant),
];

/// A body like that of a vase, with a shade above it.
fn table_lamp(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.35, 0.75);
    let body_top_m = height_m * s.uniform(0.45, 0.65);
    let foot_m = height_m * s.uniform(0.1, 0.22);
    let belly_m = height_m * s.uniform(0.04, 0.24);
    let (low, high) = (s.uniform(0.2, 0.45), s.uniform(0.6, 0.85));
    let thin_m = 0.025 * height_m;
    let profile = Profile::from(0.0, 0.0)
        .line(foot_m, 0.0)
        .line(foot_m, 0.03 * height_m)
        .curve(&[
            (0.5 * (belly_m + 0.5 * foot_m), 0.08 * height_m),
            (belly_m, low * body_top_m),
            (0.6 * belly_m, high * body_top_m),
            (thin_m, body_top_m),
        ])
        .line(0.0, body_top_m);
    let square = Section::Square(s.uniform(3.0, 7.0));
    profile.revolve(b, s.weighted(&[(3, Section::Round), (1, square)]));
    cylinder(b, 0.95 * body_top_m * DVec3::Z, 0.4 * thin_m, height_m - 0.95 * body_top_m);
    let radius_m = height_m * s.uniform(0.2, 0.42);
    let high_m = s.uniform(0.85, 1.15) * (height_m - body_top_m);
    shade(b, s, height_m, radius_m, high_m);
}

/// A foot, a pole, and a shade below its end or a bowl of light above it.
fn floor_lamp(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.2, 1.9);
    let foot_m = height_m * s.uniform(0.07, 0.13);
    let pole_m = height_m * s.uniform(0.005, 0.014);
    cylinder(b, DVec3::ZERO, foot_m, 0.015 * height_m);
    cylinder(b, DVec3::ZERO, pole_m, height_m);
    let radius_m = height_m * s.uniform(0.08, 0.18);
    if s.chance(0.7) {
        let high_m = height_m * s.uniform(0.12, 0.25);
        shade(b, s, height_m, radius_m, high_m);
    } else {
        let rise_m = radius_m * s.uniform(0.4, 0.9);
        let bowl = Profile::from(0.0, 0.0).curve(&[
            (0.45 * radius_m, 0.08 * rise_m),
            (0.85 * radius_m, 0.5 * rise_m),
            (radius_m, rise_m),
        ]);
        let vessel = Vessel::new(bowl, Wall::draw(s, radius_m), Section::Round);
        b.shifted(0.96 * height_m * DVec3::Z, |b| vessel.build(b));
    }
}

/// Three splayed legs that meet under a shade.
fn tripod(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.5, 1.7);
    let joint_m = height_m * s.uniform(0.65, 0.78);
    let reach_m = height_m * s.uniform(0.15, 0.28);
    let r = height_m * s.uniform(0.007, 0.016);
    for leg in 0..3 {
        let out = DVec2::from_angle((leg as f64 + 0.25) / 3.0 * TAU);
        rod(b, (reach_m * out).extend(0.0), (0.1 * reach_m * out).extend(joint_m), [r, r]);
    }
    cylinder(b, 0.97 * joint_m * DVec3::Z, 0.2 * reach_m, 0.04 * height_m);
    cylinder(b, joint_m * DVec3::Z, r, height_m - joint_m);
    let radius_m = height_m * s.uniform(0.13, 0.22);
    shade(b, s, height_m, radius_m, 1.02 * (height_m - joint_m));
}

/// A tall curved arm with its shade at the end.
fn arc_lamp(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.4, 2.1);
    let reach_m = height_m * s.uniform(0.35, 0.75);
    let drop_m = height_m * s.uniform(0.15, 0.35);
    let shapes = [(0.0, 0.0), (0.02, 0.5), (0.25, 0.9), (0.6, 1.0), (1.0, 1.0 - drop_m / height_m)];
    let points = shapes.map(|(y, z)| dvec3(0.0, -y * reach_m, z * height_m));
    smooth_tube(b, &points, 3, height_m * s.uniform(0.006, 0.012));
    cylinder(b, DVec3::ZERO, 0.1 * height_m, 0.04 * height_m);
    let radius_m = height_m * s.uniform(0.08, 0.14);
    b.shifted(dvec3(0.0, -reach_m, 0.0), |b| {
        shade(b, s, height_m - drop_m, radius_m, 0.9 * radius_m);
    });
}

/// A lamp head: an open cone that points to -z, with its neck at the origin.
fn head(b: &mut Builder, s: &mut Sampler, size_m: f64) {
    let wide_m = size_m * s.uniform(0.6, 0.9);
    let neck_m = size_m * s.uniform(0.2, 0.3);
    let profile = Profile::from(wide_m, -1.2 * size_m);
    let profile = if s.chance(0.4) {
        profile.curve(&[(0.8 * wide_m, -0.7 * size_m), (neck_m, -0.3 * size_m)])
    } else {
        profile.line(neck_m, -0.3 * size_m)
    };
    let profile = profile.line(neck_m, 0.15 * size_m).line(0.0, 0.2 * size_m);
    Vessel::new(profile, Wall::Sheet, Section::Round).build(b);
    let bulb = -0.75 * size_m * DVec3::Z;
    ellipsoid(b, bulb, DVec3::splat(0.25 * size_m));
    rod(b, bulb, 0.2 * size_m * DVec3::Z, [0.1 * size_m, 0.1 * size_m]);
}

/// A weighted base, two arms with joints, and a head that looks down.
fn desk_lamp(b: &mut Builder, s: &mut Sampler) {
    let arm_m = s.uniform(0.22, 0.42);
    let foot_m = arm_m * s.uniform(0.22, 0.36);
    let r = arm_m * s.uniform(0.015, 0.035);
    let back_rad = s.uniform(-0.1, 0.6);
    let over_rad = s.uniform(0.2, 1.2);
    if s.chance(0.75) {
        frustum(b, DVec3::ZERO, [foot_m, 0.9 * foot_m], 0.08 * arm_m);
    } else {
        block(b, 0.04 * arm_m * DVec3::Z, dvec3(1.6 * foot_m, 1.6 * foot_m, 0.08 * arm_m));
    }
    let shoulder = 0.06 * arm_m * DVec3::Z;
    let elbow = shoulder + arm_m * dvec3(0.0, libm::sin(back_rad), libm::cos(back_rad));
    let over = dvec3(0.0, -libm::cos(over_rad), libm::sin(over_rad));
    let wrist = elbow + arm_m * s.uniform(0.7, 1.05) * over;
    let twin = s.chance(0.5);
    for side in if twin { vec![-1.0, 1.0] } else { vec![0.0] } {
        let aside = side * 2.5 * r * DVec3::X;
        rod(b, shoulder + aside, elbow + aside, [r, r]);
        rod(b, elbow + aside, wrist + aside, [r, r]);
    }
    for joint in [shoulder, elbow, wrist] {
        ellipsoid(b, joint, dvec3(3.6 * r, 2.2 * r, 2.2 * r));
    }
    let tilt_rad = s.uniform(-0.7, 0.1);
    let size_m = arm_m * s.uniform(0.25, 0.4);
    b.turned(wrist, DAffine3::from_rotation_x(tilt_rad), |b| head(b, s, size_m));
}

/// A head on a bent neck.
fn gooseneck(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.3, 1.6);
    let reach_m = height_m.min(0.6) * s.uniform(0.4, 0.8);
    let bend_m = 0.5 * reach_m;
    let foot_m = 0.12 * height_m + 0.04;
    let mut points = vec![DVec3::ZERO, 0.5 * (height_m - bend_m) * DVec3::Z];
    for k in 0..5 {
        let (sin, cos) = libm::sincos(k as f64 / 4.0 * 0.85 * PI);
        points.push(dvec3(0.0, -bend_m * (1.0 - cos), height_m - bend_m + bend_m * sin));
    }
    smooth_tube(b, &points, 2, 0.012 * height_m + 0.003);
    frustum(b, DVec3::ZERO, [foot_m, foot_m * s.uniform(0.6, 1.0)], 0.2 * foot_m);
    b.turned(points[6], DAffine3::from_rotation_x(-0.4), |b| head(b, s, 0.35 * reach_m));
}

/// A shade, a globe or a cluster of them on cords from a ceiling plate.
fn pendant(b: &mut Builder, s: &mut Sampler) {
    let drop_m = s.uniform(0.4, 1.2);
    let n = s.pick(&[1, 1, 1, 3]);
    let radius_m = s.uniform(0.12, 0.28) / (n as f64).sqrt();
    let spread_m = if n > 1 { 1.4 * radius_m } else { 0.0 };
    cylinder(b, drop_m * DVec3::Z, 0.06 + 0.2 * spread_m, 0.025);
    let globe = s.chance(0.25);
    for lamp in 0..n {
        let out = DVec2::from_angle(lamp as f64 / n as f64 * TAU) * spread_m;
        let shift_m = if n > 1 { 0.3 * drop_m * lamp as f64 / n as f64 } else { 0.0 };
        b.shifted(out.extend(shift_m), |b| {
            let hook = (-0.8 * out).extend(drop_m - shift_m + 0.01);
            rod(b, -0.1 * DVec3::Z, hook, [0.006, 0.006]);
            if globe {
                ellipsoid(b, -radius_m * DVec3::Z, DVec3::splat(radius_m));
            } else {
                let high_m = radius_m * s.uniform(0.7, 1.6);
                shade(b, s, 0.02, radius_m, high_m);
            }
        });
    }
}
