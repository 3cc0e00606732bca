use std::f64::consts::{FRAC_PI_2, TAU};

use super::fuselage::Fuselage;
use super::wing::Wing;
use crate::primitives::*;

/// Builds in a frame at `front` with its z axis to the rear (+y).
fn rearwards(b: &mut Builder, front: DVec3, build: impl FnOnce(&mut Builder)) {
    b.turned(front, DAffine3::from_rotation_x(-FRAC_PI_2), build);
}

/// A jet engine: a ring that is open at both ends, a core, and a pylon above.
pub fn jet_engine(b: &mut Builder, front: DVec3, radius_m: f64, length_m: f64) {
    let ring = Profile::from(0.9 * radius_m, 0.0).curve(&[
        (radius_m, 0.2 * length_m),
        (radius_m, 0.5 * length_m),
        (0.75 * radius_m, 0.85 * length_m),
    ]);
    let core = Profile::from(0.0, 0.2 * length_m)
        .curve(&[(0.35 * radius_m, 0.35 * length_m), (0.6 * radius_m, 0.7 * length_m)])
        .line(0.0, 1.1 * length_m);
    rearwards(b, front, |b| {
        Vessel::new(ring, Wall::Sheet, Section::Round).build(b);
        core.revolve(b, Section::Round);
    });
    let low = front + dvec3(0.0, 0.25 * length_m, 0.9 * radius_m);
    sheet(b, [0.9 * length_m, 0.3 * radius_m], |u, v| {
        low + dvec3(0.0, (u + 0.3 * v) * 0.9 * length_m, 0.5 * v * radius_m)
    });
}

/// A closed streamlined body: a nacelle, an intake, a tip tank.
pub fn nacelle(b: &mut Builder, front: DVec3, radius_m: f64, length_m: f64) {
    let profile = Profile::from(0.0, 0.0).line(0.7 * radius_m, 0.02 * length_m).curve(&[
        (radius_m, 0.25 * length_m),
        (0.9 * radius_m, 0.65 * length_m),
        (0.25 * radius_m, length_m),
    ]);
    let profile = profile.line(0.0, length_m);
    rearwards(b, front, |b| profile.revolve(b, Section::Round));
}

/// A spinner and twisted blades without thickness.
pub fn propeller(b: &mut Builder, front: DVec3, radius_m: f64, n_blades: usize) {
    ellipsoid(b, front, dvec3(0.14, 0.25, 0.14) * radius_m);
    for blade in 0..n_blades {
        let turn_rad = (blade as f64 + 0.2) / n_blades as f64 * TAU;
        b.turned(front - 0.05 * radius_m * DVec3::Y, DAffine3::from_rotation_y(turn_rad), |b| {
            sheet(b, [radius_m, 0.12 * radius_m], |u, v| {
                let (sin, cos) = libm::sincos(1.0 - 0.6 * u);
                let across = (v - 0.5) * 0.16 * radius_m * (1.0 - 0.5 * u * u);
                dvec3(across * cos, across * sin, (0.05 + 0.95 * u) * radius_m)
            });
        });
    }
}

/// The glass of a cockpit. Half of it shows above the body.
pub fn canopy(b: &mut Builder, centre: DVec3, radius_m: f64, half_length_m: f64) {
    ellipsoid(b, centre, dvec3(0.8 * radius_m, half_length_m, 0.9 * radius_m));
}

/// One strut on each side, from the underside of the body to the middle of a high wing.
pub fn struts(b: &mut Builder, wing: &Wing, foot_m: f64) {
    let chord = wing.chord_m(0.5);
    let top = wing.leading_edge(0.5) + 0.35 * chord * DVec3::Y;
    let foot = dvec3(0.0, top.y, foot_m);
    let r = 0.025 * chord;
    b.mirrored_x(|b| rod(b, foot, top, [r, r]));
}

/// Two struts on each side between the wings of a biplane.
pub fn wing_struts(b: &mut Builder, lower: &Wing, upper: &Wing, station: f64) {
    let r = 0.02 * lower.root_chord_m;
    for chordwise in [0.15, 0.75] {
        let at =
            |wing: &Wing| wing.leading_edge(station) + chordwise * wing.chord_m(station) * DVec3::Y;
        b.mirrored_x(|b| rod(b, at(lower), at(upper), [r, r]));
    }
}

/// Two main wheels below the wings and one below the nose, on legs.
pub fn gear(b: &mut Builder, body: &Fuselage, floor_m: f64, wheel_m: f64) {
    let aside_m = 1.3 * body.radius_m();
    let main_y = 0.03 * body.length_m;
    let nose_y = -0.36 * body.length_m;
    for (x, y) in [(-aside_m, main_y), (aside_m, main_y), (0.0, nose_y)] {
        let hub = dvec3(x, y, floor_m + wheel_m);
        rod(b, hub, dvec3(0.5 * x, y, -0.2 * body.radius_m()), [0.15 * wheel_m; 2]);
        b.turned(hub - 0.2 * wheel_m * DVec3::X, DAffine3::from_rotation_y(FRAC_PI_2), |b| {
            cylinder(b, DVec3::ZERO, wheel_m, 0.4 * wheel_m);
        });
    }
}
