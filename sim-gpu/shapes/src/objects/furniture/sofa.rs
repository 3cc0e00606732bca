use crate::primitives::{Builder, DVec3, Sampler, block_between, cushion, cylinder, dvec3};

/// Builds a sofa that faces +x: one to four seats of 0.62 to 0.75 m width at 0.38 to 0.48 m height,
/// a back up to 0.7 to 0.95 m (usual measures in Neufert's Architects' Data), and perhaps a long
/// seat at one end.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let n = s.weighted(&[(1, 1), (4, 2), (4, 3), (1, 4)]);
    let seat_m = s.uniform(0.62, 0.75);
    let deep_m = s.uniform(0.5, 0.65);
    let back_deep_m = s.uniform(0.18, 0.32);
    let [seat_top_m, back_top_m] = [s.uniform(0.38, 0.48), s.uniform(0.7, 0.95)];
    let feet_m = s.uniform(0.0, 0.14);
    let soft_m = s.uniform(0.02, 0.07);
    let half_m = 0.5 * n as f64 * seat_m;
    let soft = |b: &mut Builder, low: [f64; 3], high: [f64; 3]| {
        let [low, high] = [low, high].map(DVec3::from);
        let size = high - low;
        cushion(b, (low + high) / 2.0, size, soft_m.min(0.4 * size.min_element()));
    };
    let base_m = seat_top_m - 0.15;
    block_between(b, dvec3(-back_deep_m, -half_m, feet_m), dvec3(deep_m - 0.03, half_m, base_m));
    soft(b, [-back_deep_m, -half_m, feet_m], [0.0, half_m, back_top_m - 0.1]);
    for seat in 0..n {
        let y = seat as f64 * seat_m - half_m;
        soft(b, [0.0, y, base_m], [deep_m, y + seat_m, seat_top_m]);
        soft(b, [-0.1, y, seat_top_m], [0.14, y + seat_m, back_top_m]);
    }
    let arm_m = s.uniform(0.1, 0.28);
    let arm_top_m = s.uniform(0.5, 0.68);
    let mut feet_y = half_m;
    if s.chance(0.9) {
        for side in [-1.0, 1.0] {
            let [inner, outer] = [side * half_m, side * (half_m + arm_m)];
            let [y_low, y_high] = [inner.min(outer), inner.max(outer)];
            soft(b, [-back_deep_m, y_low, feet_m], [deep_m, y_high, arm_top_m]);
        }
        feet_y += arm_m;
    }
    if n > 1 && s.chance(0.2) {
        let long_m = s.uniform(0.6, 1.0);
        soft(b, [deep_m, half_m - seat_m, feet_m], [deep_m + long_m, half_m, seat_top_m]);
    }
    for (x, y) in [
        (0.05 - back_deep_m, -1.0),
        (0.05 - back_deep_m, 1.0),
        (deep_m - 0.06, -1.0),
        (deep_m - 0.06, 1.0),
    ] {
        cylinder(b, dvec3(x, y * (feet_y - 0.06), 0.0), 0.025, feet_m + 0.02);
    }
}
