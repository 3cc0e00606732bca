//! Benches with seats at 0.42 to 0.48 m.

use crate::primitives::{Builder, DAffine3, DVec3, Sampler, block, dvec3, rod};

/// Builds a bench that faces +x, with or without a back and arms, or with a table.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let long_m = s.uniform(1.2, 2.4);
    let seat_m = s.uniform(0.42, 0.48);
    let deep_m = s.uniform(0.35, 0.5);
    if s.chance(0.15) {
        return picnic(b, s, long_m);
    }
    if s.chance(0.2) {
        return block(b, 0.5 * seat_m * DVec3::Z, dvec3(deep_m + 0.1, long_m, seat_m));
    }
    slats(b, s, dvec3(deep_m, long_m, 0.04), seat_m * DVec3::Z);
    let backed = s.chance(0.65);
    let lean_rad = s.uniform(0.1, 0.35);
    let foot = dvec3(-0.5 * deep_m, 0.0, seat_m);
    let back_m = s.uniform(0.35, 0.5);
    // The back is built as an upright seat.
    let upright = DAffine3::from_rotation_y(-lean_rad - std::f64::consts::FRAC_PI_2);
    if backed {
        let panel = dvec3(back_m - 0.08, long_m, 0.03);
        b.turned(foot, upright, |b| slats(b, s, panel, dvec3(0.5 * back_m + 0.05, 0.0, 0.0)));
    }
    let arms = backed && s.chance(0.5);
    let solid = s.chance(0.3);
    for y in [-0.42 * long_m, 0.42 * long_m] {
        side(b, [deep_m, y, seat_m], solid);
        if backed {
            let top = foot + back_m * dvec3(-libm::sin(lean_rad), 0.0, libm::cos(lean_rad));
            rod(b, foot.with_y(y), top.with_y(y), [0.025, 0.025]);
        }
        if arms {
            let rest = dvec3(0.0, y, seat_m + 0.2);
            block(b, rest, dvec3(deep_m, 0.06, 0.04));
            rod(
                b,
                rest + 0.4 * deep_m * DVec3::X,
                rest.with_z(seat_m) + 0.4 * deep_m * DVec3::X,
                [0.02, 0.02],
            );
        }
    }
}

/// The legs or the solid support of one side.
fn side(b: &mut Builder, [deep_m, y, seat_m]: [f64; 3], solid: bool) {
    if solid {
        let size = dvec3(0.8 * deep_m, 0.12, seat_m - 0.02);
        return block(b, dvec3(0.0, y, 0.5 * size.z), size);
    }
    for x in [-0.4 * deep_m, 0.4 * deep_m] {
        block(b, dvec3(x, y, 0.5 * seat_m), dvec3(0.05, 0.05, seat_m));
    }
}

/// Laths along y that fill the board of `size` about `centre`, or one board.
fn slats(b: &mut Builder, s: &mut Sampler, size: DVec3, centre: DVec3) {
    let n = s.pick(&[1, 2, 3, 5, 8]);
    let pitch_m = size.x / n as f64;
    let wide_m = if n == 1 { size.x } else { pitch_m * s.uniform(0.6, 0.9) };
    for lath in 0..n {
        let x = (lath as f64 + 0.5) * pitch_m - 0.5 * size.x;
        block(b, centre + x * DVec3::X, size.with_x(wide_m));
    }
}

/// A table with a bench on each side, in one piece.
fn picnic(b: &mut Builder, s: &mut Sampler, long_m: f64) {
    slats(b, s, dvec3(0.75, long_m, 0.04), 0.74 * DVec3::Z);
    for side in [-1.0, 1.0] {
        slats(b, s, dvec3(0.26, long_m, 0.04), dvec3(0.7 * side, 0.0, 0.45));
        for y in [-0.35 * long_m, 0.35 * long_m] {
            let [foot, top] = [dvec3(0.65 * side, y, 0.0), dvec3(0.25 * side, y, 0.72)];
            rod(b, foot, top, [0.04, 0.04]);
            rod(b, dvec3(0.0, y, 0.42), dvec3(0.75 * side, y, 0.42), [0.04, 0.04]);
        }
    }
}
