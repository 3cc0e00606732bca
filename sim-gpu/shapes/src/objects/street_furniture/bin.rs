use crate::primitives::*;

pub const MAKES: Makes =
    &[(3, litter), (4, two_wheels), (3, four_wheels), (1, skip), (1, bottle_bank), (2, group)];

/// The two-wheeled bins of EN 840-1 of 120, 240 and 360 litres: depth, width and height, metres.
const TWO_WHEELS_M: [[f64; 3]; 3] = [[0.55, 0.48, 0.93], [0.74, 0.58, 1.07], [0.86, 0.62, 1.10]];
/// The four-wheeled bins of EN 840-2 and EN 840-3 of 660, 770 and 1,100 litres.
const FOUR_WHEELS_M: [[f64; 3]; 3] = [[0.78, 1.26, 1.22], [0.78, 1.37, 1.32], [1.08, 1.37, 1.46]];

/// Draws one of the sizes, with the small differences between makers.
fn sized(s: &mut Sampler, sizes_m: &[[f64; 3]]) -> [f64; 3] {
    s.pick(sizes_m).map(|size_m| size_m * s.uniform(0.96, 1.02))
}

/// A body that widens upwards from `low_m` to `high_m`, with `size` at its upper rim.
fn body(b: &mut Builder, size: DVec2, taper: f64, low_m: f64, high_m: f64) {
    let section = |share: f64, z: f64| {
        let outline = outline::rounded_rectangle(0.5 * share * size, 0.05, 2);
        outline::at_height(&outline, z)
    };
    loft(b, &[section(taper, low_m), section(1.0, high_m)]);
}

/// A litter bin on the ground or on a post, open or with a hood.
fn litter(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.uniform(0.5, 1.0);
    let radius_m = s.uniform(0.15, 0.3);
    let lift_m = s.pick(&[0.0, 0.0, 0.3]);
    let section = s.pick(&[Section::Round, Section::Polygon(4), Section::Square(6.0)]);
    let profile = Profile::from(0.0, lift_m)
        .line(radius_m * s.uniform(0.75, 1.0), lift_m)
        .line(radius_m, lift_m + height_m);
    Vessel::new(profile, Wall::Solid(0.02), section).build(b);
    if lift_m > 0.0 {
        let post = dvec3(-radius_m - 0.04, 0.0, 0.0);
        cylinder(b, post, 0.04, lift_m + height_m + s.uniform(0.0, 0.3));
    }
    let top = (lift_m + height_m) * DVec3::Z;
    match s.count(0, 2) {
        0 => ellipsoid(b, top, dvec3(radius_m, radius_m, 0.12)),
        1 => {
            cylinder(b, top + 0.2 * DVec3::Z, 1.05 * radius_m, 0.04);
            for y in [-0.8 * radius_m, 0.8 * radius_m] {
                let foot = top + y * DVec3::Y - 0.1 * DVec3::Z;
                rod(b, foot, foot + 0.32 * DVec3::Z, [0.015, 0.015]);
            }
        }
        _ => {}
    }
}

/// A bin on two wheels that opens to the front. Its lid may be open.
fn two_wheels(b: &mut Builder, s: &mut Sampler) {
    let [deep_m, wide_m, high_m] = sized(s, &TWO_WHEELS_M);
    let rim_m = 0.92 * high_m;
    body(b, dvec2(0.88 * deep_m, wide_m), s.uniform(0.72, 0.85), 0.05, rim_m);
    lid(b, s, dvec3(deep_m, wide_m, high_m - rim_m), rim_m);
    // The handle and the wheels are at the rear.
    let handle = dvec3(-0.5 * deep_m, 0.0, rim_m - 0.03);
    rod(b, handle - 0.4 * wide_m * DVec3::Y, handle + 0.4 * wide_m * DVec3::Y, [0.015, 0.015]);
    for side in [-1.0, 1.0] {
        wheel(b, dvec3(-0.36 * deep_m, side * 0.42 * wide_m, 0.1), 0.1);
    }
}

/// A lid of `size` with its hinges at the rear, shut or open.
fn lid(b: &mut Builder, s: &mut Sampler, size: DVec3, rim_m: f64) {
    let open = s.chance(0.08);
    let turn_rad = if open { -s.uniform(1.7, 4.3) } else { -s.uniform(-0.03, 0.06) };
    let hinge = dvec3(-0.46 * size.x, 0.0, rim_m);
    let row = |share: f64, z: f64| -> Vec<DVec3> {
        let outline = outline::rectangle(0.5 * share * size.truncate());
        outline.iter().map(|p| (p + 0.46 * size.x * DVec2::X).extend(z)).collect()
    };
    let rows = [row(1.0, 0.0), row(1.0, 0.4 * size.z), row(0.8, size.z)];
    b.turned(hinge, DAffine3::from_rotation_y(turn_rad), |b| loft(b, &rows));
}

fn wheel(b: &mut Builder, centre: DVec3, radius_m: f64) {
    let half = 0.025 * DVec3::Y;
    rod(b, centre - half, centre + half, [radius_m, radius_m]);
}

/// A bin on four wheels under a flat, a sloping or a round lid.
fn four_wheels(b: &mut Builder, s: &mut Sampler) {
    let [deep_m, wide_m, high_m] = sized(s, &FOUR_WHEELS_M);
    let rim_m = 0.85 * high_m;
    body(b, dvec2(0.95 * deep_m, 0.95 * wide_m), s.uniform(0.78, 0.9), 0.2, rim_m);
    if s.chance(0.5) {
        let half = dvec3(0.5 * deep_m, 0.5 * wide_m, high_m - rim_m);
        b.shifted(rim_m * DVec3::Z, |b| loft(b, &[-1.0, 1.0].map(|side| arch(half, side))));
    } else {
        lid(b, s, dvec3(deep_m, wide_m, high_m - rim_m), rim_m);
    }
    for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        wheel(b, dvec3(0.33 * x * deep_m, 0.38 * y * wide_m, 0.1), 0.1);
    }
    for side in [-1.0, 1.0] {
        // The trunnions, where lorries lift the bin.
        let at = dvec3(0.0, side * 0.5 * wide_m, 0.8 * high_m);
        rod(b, at, at + 0.06 * side * DVec3::Y, [0.025, 0.025]);
    }
}

/// One end of a round lid: an arch over the x axis.
fn arch(half: DVec3, side: f64) -> Vec<DVec3> {
    let at = |k: usize| libm::sincos(k as f64 / 6.0 * std::f64::consts::PI);
    (0..=6).map(at).map(|(sin, cos)| half * dvec3(cos, side, sin)).collect()
}

/// An open container with sloping ends.
fn skip(b: &mut Builder, s: &mut Sampler) {
    let half = dvec2(s.uniform(1.4, 1.95), s.uniform(0.8, 0.95));
    let high_m = s.uniform(1.0, 1.6);
    let section = |share: f64, z: f64, inset: f64| {
        let half = (1.0 - inset) * half * dvec2(share, 1.0);
        outline::at_height(&outline::rectangle(half), z)
    };
    let foot = s.uniform(0.55, 0.75);
    let floor_m = high_m * s.uniform(0.1, 0.9);
    let filled = foot + (1.0 - foot) * floor_m / high_m;
    let rows = [section(foot, 0.1, 0.0), section(1.0, high_m, 0.0), section(1.0, high_m, 0.02)];
    let inner = [section(filled, floor_m, 0.02), vec![floor_m * DVec3::Z]];
    b.grid(&rows.into_iter().chain(inner).collect::<Vec<_>>(), true);
    for x in [-0.4 * half.x, 0.4 * half.x] {
        block(b, dvec3(x, 0.0, 0.05), dvec3(0.2, 1.6 * half.y, 0.1));
    }
}

/// A bank for bottles or clothes: a dome or a tall box.
fn bottle_bank(b: &mut Builder, s: &mut Sampler) {
    let high_m = s.uniform(1.5, 1.9);
    let half_m = s.uniform(0.55, 0.8);
    if s.chance(0.5) {
        return Profile::from(0.85 * half_m, 0.0)
            .line(half_m, 0.35 * high_m)
            .curve(&[(0.85 * half_m, 0.75 * high_m), (0.4 * half_m, 0.97 * high_m), (0.0, high_m)])
            .revolve(b, s.pick(&[Section::Round, Section::Square(5.0)]));
    }
    prism(b, &outline::rounded_rectangle(half_m * dvec2(0.9, 1.0), 0.1, 2), 0.05, high_m, 1.0);
    block(b, dvec3(0.9 * half_m, 0.0, 0.75 * high_m), dvec3(0.1, 0.8 * half_m, 0.25));
}

/// Bins beside each other, as on the day of their collection.
fn group(b: &mut Builder, s: &mut Sampler) {
    let mut y = 0.0;
    for _ in 0..s.count(2, 4) {
        let place = dvec3(s.uniform(-0.08, 0.08), y, 0.0);
        b.turned(place, DAffine3::from_rotation_z(s.uniform(-0.15, 0.15)), |b| two_wheels(b, s));
        y += s.uniform(0.66, 0.8);
    }
}
