//! Things that belong to no other kind.

use crate::objects::plant::bush;
use crate::objects::plant::uneven::{Lump, Ripple, direction};
use crate::primitives::*;

pub const MAKES: Makes = &[
    (3, boxes),
    (3, rocks),
    (1, hydrant),
    (4, cabinet),
    (2, flower_tub),
    (1, trolley),
    (2, a_board),
    (2, pallets),
    (2, drum),
];

/// Cardboard boxes beside and on top of each other.
fn boxes(b: &mut Builder, s: &mut Sampler) {
    let mut top = DVec3::ZERO;
    for _ in 0..s.count(1, 7) {
        let size = dvec3(s.uniform(0.25, 0.8), s.uniform(0.25, 0.8), s.uniform(0.15, 0.7));
        let turn = DAffine3::from_rotation_z(s.uniform(-0.5, 0.5));
        let low = if s.chance(0.5) && top.z < 1.2 {
            top + 0.1 * direction(s).with_z(0.0)
        } else {
            1.2 * s.uniform(0.4, 1.0) * direction(s).with_z(0.0)
        };
        b.turned(low + 0.5 * size.z * DVec3::Z, turn, |b| block(b, DVec3::ZERO, size));
        top = low + size.z * DVec3::Z;
    }
}

/// A boulder or a heap of stones, earth or bags.
fn rocks(b: &mut Builder, s: &mut Sampler) {
    let n = s.weighted(&[(3, 1), (1, 2), (1, 4)]);
    let heap_m = if n > 1 { s.uniform(0.3, 1.0) } else { 0.0 };
    for _ in 0..n {
        let size_m = if n > 1 { s.log_uniform(0.3, 0.8) } else { s.log_uniform(0.3, 1.2) };
        let radii_m = size_m * dvec3(1.0, s.uniform(0.6, 1.0), s.uniform(0.5, 0.9));
        let rough_m = s.uniform(0.02, 0.12) * size_m;
        let at = heap_m * direction(s).with_z(0.0);
        Lump {
            centre: at + s.uniform(0.3, 0.9) * radii_m.z * DVec3::Z,
            radii_m,
            exponent: s.uniform(2.0, 4.5),
            ripple: Ripple::draw(s, 0.9 * size_m, rough_m),
        }
        .build(b);
    }
}

/// A pillar hydrant: 0.6 to 1 m high, with caps at its sides.
fn hydrant(b: &mut Builder, s: &mut Sampler) {
    let high_m = s.uniform(0.6, 1.0);
    let radius_m = s.uniform(0.08, 0.13);
    Profile::from(1.5 * radius_m, 0.0)
        .line(1.5 * radius_m, 0.05)
        .line(radius_m, 0.06)
        .line(radius_m, 0.75 * high_m)
        .line(1.25 * radius_m, 0.77 * high_m)
        .line(1.1 * radius_m, 0.88 * high_m)
        .line(0.4 * radius_m, 0.95 * high_m)
        .line(0.3 * radius_m, high_m)
        .line(0.0, high_m)
        .revolve(b, Section::Round);
    let cap = 0.6 * high_m * DVec3::Z;
    let out = 1.6 * radius_m;
    rod(b, cap - out * DVec3::Y, cap + out * DVec3::Y, [0.05, 0.05]);
    rod(b, cap, cap + out * DVec3::X, [0.06, 0.06]);
}

/// A roadside cabinet for electricity or telephone, 0.8 to 1.8 m high.
fn cabinet(b: &mut Builder, s: &mut Sampler) {
    let size = dvec3(s.uniform(0.25, 0.6), s.uniform(0.4, 1.8), s.uniform(0.75, 1.8));
    let foot_m = s.uniform(0.05, 0.2);
    block(b, 0.5 * foot_m * DVec3::Z, size.with_z(foot_m) * dvec3(0.85, 0.95, 1.0));
    block(b, (foot_m + 0.5 * size.z) * DVec3::Z, size);
    block(b, (foot_m + size.z + 0.025) * DVec3::Z, dvec3(size.x + 0.06, size.y + 0.06, 0.05));
    block(b, dvec3(0.5 * size.x + 0.015, 0.1, foot_m + 0.55 * size.z), dvec3(0.03, 0.04, 0.15));
}

/// A tub or trough of stone with plants in it.
fn flower_tub(b: &mut Builder, s: &mut Sampler) {
    let radius_m = s.uniform(0.25, 0.7);
    let high_m = s.uniform(0.3, 0.8);
    let section = s.pick(&[Section::Round, Section::Polygon(4), Section::Polygon(6)]);
    Profile::from(0.75 * radius_m, 0.0)
        .line(radius_m, high_m)
        .line(0.88 * radius_m, high_m)
        .line(0.0, high_m - 0.06)
        .revolve(b, section);
    let plants = s.uniform(0.25, 0.5);
    let lift = DAffine3::from_translation((high_m - 0.06) * DVec3::Z);
    b.place(lift * DAffine3::from_scale(DVec3::splat(plants)), |b| build_one(bush::MAKES, b, s));
}

/// A shopping trolley of wire on four wheels.
fn trolley(b: &mut Builder, s: &mut Sampler) {
    let [long_m, wide_m] = [s.uniform(0.75, 1.0), s.uniform(0.5, 0.6)];
    let ring = |share: f64, z: f64| {
        let half = dvec2(0.5 * long_m * share, 0.5 * wide_m * (0.6 + 0.4 * share));
        outline::at_height(&outline::rectangle(half), z)
    };
    let [floor, rim] = [ring(0.75, 0.5), ring(1.0, 0.95)];
    for side in 0..4 {
        let next = (side + 1) % 4;
        rod(b, floor[side], floor[next], [0.012, 0.012]);
        rod(b, rim[side], rim[next], [0.012, 0.012]);
        for wire in 0..9 {
            let share = wire as f64 / 9.0;
            let from = floor[side].lerp(floor[next], share);
            rod(b, from, rim[side].lerp(rim[next], share), [0.005, 0.005]);
        }
        let foot = dvec3(0.9 * rim[side].x, 0.9 * rim[side].y, 0.06);
        rod(b, foot, floor[side], [0.015, 0.015]);
        rod(b, foot - 0.015 * DVec3::Y, foot + 0.015 * DVec3::Y, [0.06, 0.06]);
    }
    let handle = dvec3(-0.55 * long_m, 0.0, 1.02);
    rod(b, handle - 0.5 * wide_m * DVec3::Y, handle + 0.5 * wide_m * DVec3::Y, [0.015, 0.015]);
}

/// Two boards that lean against each other, in front of a shop.
fn a_board(b: &mut Builder, s: &mut Sampler) {
    let high_m = s.uniform(0.8, 1.3);
    let size = dvec3(0.025, s.uniform(0.5, 0.8), high_m);
    let lean_rad = s.uniform(0.12, 0.35);
    for side in [-1.0, 1.0] {
        let top = high_m * libm::cos(lean_rad) * DVec3::Z;
        let lean = DAffine3::from_rotation_y(-side * lean_rad);
        b.turned(top, lean, |b| block(b, -0.5 * high_m * DVec3::Z, size));
    }
}

/// A stack of pallets of 0.8 by 1.2 m and 0.144 m height (EN 13698-1), with or without a load.
fn pallets(b: &mut Builder, s: &mut Sampler) {
    let n = s.count(2, 10);
    for pallet in 0..n {
        let turn = DAffine3::from_rotation_z(s.uniform(-0.05, 0.05));
        b.turned(0.144 * pallet as f64 * DVec3::Z, turn, |b| {
            block(b, 0.133 * DVec3::Z, dvec3(0.8, 1.2, 0.022));
            for x in [-0.35, 0.0, 0.35] {
                block(b, dvec3(x, 0.0, 0.011), dvec3(0.1, 1.2, 0.022));
                for y in [-0.53, 0.0, 0.53] {
                    block(b, dvec3(x, y, 0.072), dvec3(0.1, 0.14, 0.1));
                }
            }
        });
    }
    if n < 4 && s.chance(0.6) {
        let load = dvec3(0.78, 1.15, s.uniform(0.4, 1.5));
        block(b, (0.144 * n as f64 + 0.5 * load.z) * DVec3::Z, load);
    }
}

/// A barrel, or a traffic drum (MUTCD: 0.9 m high, 0.45 m wide).
fn drum(b: &mut Builder, s: &mut Sampler) {
    let radius_m = s.uniform(0.2, 0.32);
    let high_m = s.uniform(0.7, 1.0);
    let mut profile = Profile::from(s.uniform(1.0, 1.3) * radius_m, 0.0).line(radius_m, 0.06);
    for hoop in [0.33, 0.66] {
        let z = hoop * high_m;
        profile =
            profile.line(radius_m, z).line(1.05 * radius_m, z + 0.02).line(radius_m, z + 0.04);
    }
    profile.line(0.92 * radius_m, high_m).line(0.0, high_m).revolve(b, Section::Round);
}
