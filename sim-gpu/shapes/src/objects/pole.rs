pub mod lamp_post;
pub mod traffic_light;
pub mod traffic_sign;

use crate::primitives::*;

pub const MAKES: Makes =
    &[(3, bollard), (4, post), (3, utility), (4, pillar), (1, delineator), (2, meter)];

/// An upright shaft of `radii_m` at its foot and top, from the ground up.
fn shaft(b: &mut Builder, radii_m: [f64; 2], height_m: f64, section: Section) {
    Profile::from(radii_m[0], 0.0)
        .line(radii_m[1], height_m)
        .line(0.0, height_m)
        .revolve(b, section);
}

fn draw_section(s: &mut Sampler) -> Section {
    s.weighted(&[(5, Section::Round), (2, Section::Polygon(4)), (1, Section::Polygon(8))])
}

/// A bollard, 0.6 to 1.2 m high, with a plain, round or widened head.
fn bollard(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.6, 1.2);
    let radius_m = s.log_uniform(0.04, 0.16);
    let section = draw_section(s);
    shaft(b, [radius_m, radius_m * s.uniform(0.75, 1.0)], height_m, section);
    match s.count(0, 3) {
        0 => ellipsoid(b, height_m * DVec3::Z, DVec3::splat(1.1 * radius_m)),
        1 => cylinder(b, 0.86 * height_m * DVec3::Z, 1.25 * radius_m, 0.06),
        2 => frustum(b, DVec3::ZERO, [1.7 * radius_m, 1.2 * radius_m], 0.15 * height_m),
        _ => {}
    }
}

/// A post of metal, timber or concrete, on a foot plate or leaning.
fn post(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.0, 4.0);
    let radius_m = s.log_uniform(0.025, 0.12);
    let section = draw_section(s);
    let lean_m = s.uniform(-0.08, 0.08) * height_m;
    if s.chance(0.3) {
        return rod(b, DVec3::ZERO, dvec3(lean_m, 0.0, height_m), [radius_m, radius_m]);
    }
    shaft(b, [radius_m, radius_m], height_m, section);
    if s.chance(0.3) {
        cushion(b, 0.02 * DVec3::Z, dvec3(4.0 * radius_m, 4.0 * radius_m, 0.04), 0.01);
    }
}

/// A utility pole: 0.2 to 0.4 m thick at its foot (ANSI O5.1, class 5 to 1), with cross-arms and
/// perhaps a transformer.
fn utility(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(6.0, 10.0);
    let radius_m = s.uniform(0.1, 0.2);
    shaft(b, [radius_m, 0.65 * radius_m], height_m, Section::Round);
    let half_m = s.uniform(0.5, 0.95);
    for arm in 0..s.count(0, 2) {
        let z = height_m - 0.3 - 0.8 * arm as f64;
        block(b, z * DVec3::Z, dvec3(0.1, 2.0 * half_m, 0.12));
        for y in [-0.9, -0.4, 0.4, 0.9] {
            cylinder(b, dvec3(0.0, y * half_m, z + 0.06), 0.05, 0.15);
        }
    }
    if s.chance(0.25) {
        cylinder(b, dvec3(radius_m + 0.25, 0.0, height_m - 2.5), 0.25, 0.9);
    }
    if s.chance(0.3) {
        let z = s.uniform(0.8, 1.8);
        block(b, dvec3(radius_m + 0.1, 0.0, z), dvec3(0.2, 0.3, 0.5));
    }
}

/// A pillar up to 1 m thick, with or without a base and a capital.
fn pillar(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.2, 5.0);
    let radius_m = s.log_uniform(0.1, 0.5);
    let fluted = Section::Fluted { count: 12, depth: 0.04 };
    let square = Section::Square(s.uniform(5.0, 12.0));
    let sections = [(4, Section::Round), (2, square), (1, Section::Polygon(8)), (1, fluted)];
    let section = s.weighted(&sections);
    if s.chance(0.4) {
        let size = dvec3(2.0 * radius_m, radius_m * s.uniform(0.6, 3.9), height_m);
        block(b, 0.5 * size * DVec3::Z, size);
    } else {
        shaft(b, [radius_m, radius_m * s.uniform(0.8, 1.0)], height_m, section);
    }
    let wide_m = (2.0 * radius_m * s.uniform(1.1, 1.5)).min(1.4);
    for z in [0.05, 0.97] {
        if s.chance(0.4) {
            let high_m = s.uniform(0.08, 0.3);
            block(b, z * height_m * DVec3::Z, dvec3(wide_m, wide_m, high_m));
        }
    }
}

/// A delineator beside a road: a hollow three-sided post, 1.05 m high (Germany's HLB).
fn delineator(b: &mut Builder, s: &mut Sampler) {
    let section = outline::ellipse(dvec2(0.04, 0.06) * s.uniform(0.8, 1.3), s.pick(&[3, 8]));
    prism(b, &section, 0.0, s.uniform(0.9, 1.1), s.uniform(0.8, 1.0));
}

/// A post with a small casing at the height of a hand or a head: a parking meter, a ticket machine,
/// a letter box, a charging point.
fn meter(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(1.1, 1.9);
    let size = dvec3(s.uniform(0.12, 0.4), s.uniform(0.18, 0.5), s.uniform(0.2, 0.9));
    let radius_m = s.uniform(0.025, 0.09);
    shaft(b, [radius_m, radius_m], height_m - 0.5 * size.z, draw_section(s));
    cushion(b, (height_m - 0.5 * size.z) * DVec3::Z, size, 0.04);
}
