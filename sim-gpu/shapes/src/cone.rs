use std::f64::consts::PI;

use crate::primitives::*;

pub const MAKES: Makes =
    &[(3, plain), (2, traffic_cone), (1, party_hat), (1, ice_cream), (1, funnel)];

/// A cone or frustum, round or many-sided, closed or open below, upright or on its tip.
fn plain(b: &mut Builder, s: &mut Sampler) {
    let base_m = s.log_uniform(0.05, 1.0);
    let height_m = base_m * s.log_uniform(0.6, 5.0);
    let tip_m = if s.chance(0.4) { base_m * s.uniform(0.1, 0.6) } else { 0.0 };
    let polygon = Section::Polygon(s.pick(&[4, 6, 8, 12]));
    let section = s.weighted(&[(3, Section::Round), (1, polygon)]);
    let closed_below = s.chance(0.6);
    let closed_above = tip_m == 0.0 || s.chance(0.5);
    let mut profile = Profile::from(if closed_below { 0.0 } else { base_m }, 0.0);
    if closed_below {
        profile = profile.line(base_m, 0.0);
    }
    profile = profile.line(tip_m, height_m);
    if closed_above && tip_m > 0.0 {
        profile = profile.line(0.0, height_m);
    }
    let on_tip = s.chance(0.12);
    let pose = if on_tip { DAffine3::from_rotation_x(PI) } else { DAffine3::IDENTITY };
    b.place(pose, |b| profile.revolve(b, section));
}

/// A truncated cone with collars on a plate.
fn traffic_cone(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.3, 1.0);
    let foot_m = height_m * s.uniform(0.16, 0.3);
    let tip_m = foot_m * s.uniform(0.12, 0.35);
    let plate_m = foot_m * s.uniform(1.15, 1.6);
    let thick_m = height_m * s.uniform(0.02, 0.06);
    let half = DVec2::splat(plate_m);
    let square = outline::rectangle(half);
    let rounded = outline::rounded_rectangle(half, 0.3 * plate_m, b.around(0.3 * plate_m, 12) / 4);
    let octagon = outline::ellipse(half * 1.08, 8);
    let disc = outline::ellipse(half, b.around(plate_m, 12));
    prism(b, &s.pick(&[square, rounded, octagon, disc]), 0.0, thick_m, s.uniform(0.85, 1.0));
    let radius = |share: f64| foot_m + share * (tip_m - foot_m);
    let mut profile = Profile::from(foot_m, 0.9 * thick_m);
    for collar in 0..s.count(0, 3) {
        let from = 0.25 + 0.22 * collar as f64;
        let swell = 0.03 * foot_m;
        for (share, out) in [(from, 0.0), (from, swell), (from + 0.12, swell), (from + 0.12, 0.0)] {
            profile = profile.line(radius(share) + out, thick_m + share * height_m);
        }
    }
    profile = profile.line(tip_m, thick_m + height_m);
    if s.chance(0.4) {
        profile = profile.line(0.0, thick_m + height_m);
    }
    profile.revolve(b, Section::Round);
}

/// A paper cone, open below, with or without a brim and a ball on its tip.
fn party_hat(b: &mut Builder, s: &mut Sampler) {
    let base_m = s.uniform(0.05, 0.14);
    let height_m = base_m * s.uniform(1.3, 4.0);
    let brim_m = if s.chance(0.5) { base_m * s.uniform(1.15, 1.9) } else { base_m };
    let ball_m = base_m * s.uniform(0.12, 0.25);
    let mut profile = Profile::from(brim_m, 0.0).line(base_m, 0.02 * height_m);
    if s.chance(0.3) {
        profile =
            profile.curve(&[(0.6 * base_m, 0.3 * height_m), (0.28 * base_m, 0.65 * height_m)]);
    }
    profile.line(0.0, height_m).revolve(b, Section::Round);
    if s.chance(0.6) {
        ellipsoid(b, height_m * DVec3::Z, DVec3::splat(ball_m));
    }
}

/// A wafer on its tip, with scoops or empty.
fn ice_cream(b: &mut Builder, s: &mut Sampler) {
    let rim_m = s.uniform(0.025, 0.04);
    let height_m = rim_m * s.uniform(2.5, 5.0);
    let tip_m = rim_m * s.uniform(0.0, 0.3);
    let profile = Profile::from(tip_m, 0.0).line(rim_m, height_m);
    Vessel::new(profile, Wall::draw(s, rim_m), Section::Round).build(b);
    for scoop in 0..s.count(0, 2) {
        let radius_m = rim_m * (1.05 - 0.1 * scoop as f64);
        let z = height_m + (0.4 + 1.2 * scoop as f64) * rim_m;
        ellipsoid(b, z * DVec3::Z, DVec3::splat(radius_m));
    }
}

/// A wide mouth above a narrow spout, open at both ends.
fn funnel(b: &mut Builder, s: &mut Sampler) {
    let mouth_m = s.uniform(0.05, 0.2);
    let spout_m = mouth_m * s.uniform(0.08, 0.2);
    let spout_length_m = mouth_m * s.uniform(0.1, 1.0);
    let top_m = spout_length_m + mouth_m * s.uniform(0.9, 2.2);
    let profile = Profile::from(0.8 * spout_m, 0.0)
        .line(spout_m, spout_length_m)
        .line(mouth_m, top_m)
        .line(mouth_m, top_m + 0.1 * mouth_m);
    Vessel::new(profile, Wall::draw(s, mouth_m), Section::Round).build(b);
}
