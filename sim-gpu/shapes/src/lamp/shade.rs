use crate::primitives::*;

/// A shade below `top_m`, `high_m` high and `radius_m` wide at its lower edge, with the bulb
/// inside. Most shades are open at both ends.
pub fn shade(b: &mut Builder, s: &mut Sampler, top_m: f64, radius_m: f64, high_m: f64) {
    let narrow_m = radius_m * s.uniform(0.35, 1.0);
    let low_m = top_m - high_m;
    let below = Profile::from(radius_m, low_m);
    let at = |share: f64| low_m + share * high_m;
    let bell = [(0.5 * (radius_m + narrow_m), at(0.25)), (narrow_m, at(0.7))];
    let dome = [(0.92 * radius_m, at(0.4)), (0.65 * radius_m, at(0.77))];
    let curve = |[low, high]: [(f64, f64); 2], neck_m: f64| {
        (below.clone().curve(&[low, high, (neck_m, top_m)]), neck_m)
    };
    let (profile, neck_m) = s.weighted(&[
        (3, (below.clone().line(narrow_m, top_m), narrow_m)),
        (1, curve(bell, 0.9 * narrow_m)),
        (1, curve(dome, 0.1 * radius_m)),
    ]);
    let pleats = Section::Fluted { count: s.count(16, 32), depth: 0.03 };
    let section = s.weighted(&[(3, Section::Round), (1, Section::Polygon(4)), (1, pleats)]);
    let wall = s.weighted(&[(2, Wall::Sheet), (1, Wall::Solid(0.02 * radius_m))]);
    Vessel::new(profile, wall, section).build(b);
    let bulb_m = 0.22 * narrow_m.min(high_m);
    let bulb = (low_m + 0.5 * high_m) * DVec3::Z;
    ellipsoid(b, bulb, dvec3(bulb_m, bulb_m, 1.4 * bulb_m));
    spider(b, bulb, top_m, 0.97 * neck_m);
}

/// Four wires at `top_m` that hold a shade, and the socket of its bulb.
fn spider(b: &mut Builder, bulb: DVec3, top_m: f64, reach_m: f64) {
    let r = 0.015 * reach_m;
    let hub = top_m * DVec3::Z;
    for out in [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y] {
        rod(b, hub, hub + reach_m * out, [r, r]);
    }
    rod(b, bulb, hub, [4.0 * r, 2.0 * r]);
}
