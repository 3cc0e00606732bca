use crate::primitives::{Builder, DAffine3, DVec3, Sampler, block, block_between, dvec3, rod};

/// Builds a door that faces +x, shut or ajar, with one or two leaves of 0.735 to 0.985 m by 1.985
/// to 2.11 m and 0.04 m thickness (DIN 18101), and sometimes with a part of the wall on either
/// side.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let wide_m = s.pick(&[0.735, 0.86, 0.86, 0.985]);
    let high_m = s.pick(&[1.985, 1.985, 2.11]);
    let n = s.weighted(&[(4, 1), (1, 2)]);
    let half_m = 0.5 * n as f64 * wide_m;
    let frame_m = s.uniform(0.04, 0.09);
    let deep_m = s.uniform(0.08, 0.25);
    let wall_m = if s.chance(0.3) { s.uniform(0.1, 0.5) } else { frame_m };
    let lintel_m = high_m + if wall_m > frame_m { s.uniform(0.1, 0.5) } else { frame_m };
    for side in [-1.0, 1.0] {
        let inner = dvec3(-0.5 * deep_m, side * half_m, 0.0);
        block_between(b, inner, dvec3(0.5 * deep_m, side * (half_m + wall_m), lintel_m));
    }
    block_between(b, dvec3(-0.5 * deep_m, -half_m, high_m), dvec3(0.5 * deep_m, half_m, lintel_m));
    let pane = s.chance(0.2);
    for leaf in 0..n {
        let side = if leaf == 0 { 1.0 } else { -1.0 };
        let open_rad = if s.chance(0.5) { s.uniform(0.0, 1.9) } else { 0.0 };
        // The second leaf is the mirror image of the first.
        let frame = DAffine3::from_scale(dvec3(1.0, side, 1.0))
            * DAffine3::from_translation(-half_m * DVec3::Y)
            * DAffine3::from_rotation_z(-open_rad);
        b.place(frame, |b| door_leaf(b, [wide_m, high_m], pane));
    }
}

/// A leaf along y from its hinge, with a handle at 1.05 m and perhaps a pane of glass.
fn door_leaf(b: &mut Builder, [wide_m, high_m]: [f64; 2], pane: bool) {
    let half_m = 0.02;
    let mut panel = |low: [f64; 2], high: [f64; 2]| {
        block_between(b, dvec3(-half_m, low[0], low[1]), dvec3(half_m, high[0], high[1]));
    };
    if pane {
        let [left, right, floor, top] = [0.14, wide_m - 0.14, 0.9, high_m - 0.15];
        panel([0.0, 0.01], [wide_m, floor]);
        panel([0.0, top], [wide_m, high_m]);
        panel([0.0, floor], [left, top]);
        panel([right, floor], [wide_m, top]);
        b.glass(|b| {
            let size = dvec3(0.006, right - left, top - floor);
            block(b, dvec3(0.0, 0.5 * wide_m, 0.5 * (floor + top)), size);
        });
    } else {
        panel([0.0, 0.01], [wide_m, high_m]);
    }
    for x in [-0.06, 0.06] {
        let handle = dvec3(x, wide_m - 0.06, 1.05);
        rod(b, handle.with_x(0.0), handle, [0.01, 0.01]);
        rod(b, handle, handle - 0.12 * DVec3::Y, [0.01, 0.01]);
    }
}
