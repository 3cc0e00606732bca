use super::Top;
use crate::primitives::{Builder, DVec3, Sampler, block, block_between, dvec3};

/// A desk with a cabinet at one end and a panel or a second cabinet at the other.
pub fn desk(b: &mut Builder, s: &mut Sampler, top: &Top) {
    let wide_m = (top.half.y * s.uniform(0.35, 0.6)).min(0.55);
    let both = s.chance(0.4) && top.half.y > 0.6;
    let n_drawers = s.count(2, 4);
    let handle_m = s.uniform(0.2, 0.6) * wide_m;
    for side in [1.0, -1.0] {
        let y = side * (0.96 * top.half.y - 0.5 * wide_m);
        if side > 0.0 || both {
            cabinet(b, top, y, wide_m, n_drawers, handle_m);
        } else {
            let edge = dvec3(-0.92 * top.half.x, -0.96 * top.half.y, 0.0);
            block_between(b, edge, edge * dvec3(-1.0, 0.93, 1.0) + top.under_m() * DVec3::Z);
        }
    }
    let back = dvec3(0.85 * top.half.x, 0.0, 0.65 * top.height_m);
    block(b, back, dvec3(0.02, 1.85 * top.half.y, 0.6 * top.height_m));
}

/// A box under the top with `n` drawers on the side of -x.
fn cabinet(b: &mut Builder, top: &Top, y: f64, wide_m: f64, n: usize, handle_m: f64) {
    let low_m = 0.06 * top.height_m;
    let deep_m = 0.9 * top.half.x;
    let corner = dvec3(deep_m, y + 0.5 * wide_m, top.under_m());
    block_between(b, dvec3(-deep_m, y - 0.5 * wide_m, low_m), corner);
    let high_m = (top.under_m() - low_m) / n as f64;
    for drawer in 0..n {
        let z = low_m + (drawer as f64 + 0.5) * high_m;
        let front = dvec3(-deep_m - 0.01, y, z);
        block(b, front, dvec3(0.02, 0.92 * wide_m, 0.88 * high_m));
        block(b, front - 0.02 * DVec3::X, dvec3(0.02, handle_m, 0.015));
    }
}
