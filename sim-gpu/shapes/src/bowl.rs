use crate::primitives::{Builder, Profile, Sampler, Section, Vessel, Wall, dvec3, smooth, tube};

/// Builds a bowl. Deep bowls have the proportions of cups or vases.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let rim_m = s.log_uniform(0.05, 0.2);
    let height_m = rim_m * s.log_uniform(0.3, 1.5);
    let foot_m = rim_m * s.uniform(0.25, 0.65);
    let ring_m = if s.chance(0.45) { height_m * s.uniform(0.05, 0.35) } else { 0.0 };
    let outside = outside(s, [rim_m, foot_m], [height_m, ring_m]);
    let mut vessel = Vessel::new(outside, Wall::draw(s, rim_m), section(s));
    vessel.hollow_from_m = ring_m;
    vessel.build(b);
    if matches!(vessel.section, Section::Round) && s.chance(0.15) {
        lugs(b, s, rim_m, height_m);
    }
}

fn section(s: &mut Sampler) -> Section {
    let oval = Section::Oval(s.uniform(0.55, 0.9));
    let square = Section::Square(s.uniform(3.0, 7.0));
    let polygon = Section::Polygon(s.count(6, 10));
    let fluted = Section::Fluted { count: s.count(8, 20), depth: s.uniform(0.02, 0.06) };
    s.weighted(&[(6, Section::Round), (1, oval), (1, square), (1, polygon), (1, fluted)])
}

/// The outer profile from the radii of the rim and the foot, and the heights of the rim and of the
/// ring that the bowl stands on.
fn outside(s: &mut Sampler, [rim_m, foot_m]: [f64; 2], [height_m, ring_m]: [f64; 2]) -> Profile {
    let ring_foot_m = foot_m * s.uniform(0.9, 1.3);
    let depth_m = height_m - ring_m;
    let at = |share: f64| ring_m + share * depth_m;
    let mut profile = Profile::from(0.0, 0.0);
    if ring_m > 0.0 {
        profile = profile.line(ring_foot_m, 0.0);
    }
    let profile = profile.line(foot_m, ring_m);
    let between = |share: f64| foot_m + share * (rim_m - foot_m);
    let rim = (rim_m, height_m);
    let curve = |through: [(f64, f64); 3]| profile.clone().curve(&through);
    let round = curve([(between(0.55), at(0.17)), (between(0.87), at(0.52)), rim]);
    let flared = curve([(between(0.45), at(0.25)), (between(0.6), at(0.75)), rim]);
    let closing = curve([(between(0.75), at(0.25)), (rim_m, at(0.6)), (0.85 * rim_m, height_m)]);
    let conical = profile.line(rim_m, height_m);
    // The probability of a lip, and its end over the radius and the height of the rim.
    let (profile, lip) = s.weighted(&[
        (3, (round, Some((0.3, 1.15, 1.01)))),
        (1, (conical, None)),
        (1, (flared, None)),
        (1, (closing, Some((0.4, 0.95, 1.03)))),
    ]);
    match lip {
        Some((chance, out, up)) if s.chance(chance) => profile.line(out * rim_m, up * height_m),
        _ => profile,
    }
}

fn lugs(b: &mut Builder, s: &mut Sampler, rim_m: f64, height_m: f64) {
    let out_m = rim_m * s.uniform(1.2, 1.4);
    let side_m = 0.3 * rim_m;
    let z = 0.85 * height_m;
    let points = [
        dvec3(0.8 * rim_m, -side_m, z),
        dvec3(out_m, -0.6 * side_m, z),
        dvec3(out_m, 0.6 * side_m, z),
        dvec3(0.8 * rim_m, side_m, z),
    ];
    let path = smooth(b, &points, 3);
    b.mirrored_x(|b| tube(b, &path, 0.06 * rim_m));
}
