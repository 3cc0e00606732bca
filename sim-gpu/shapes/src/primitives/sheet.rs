//! Surfaces that a function defines, with or without thickness.

use glam::DVec3;

use super::Builder;

/// The surface `at(u, v)`, with u and v in 0..=1, without thickness. `size_m` are its approximate
/// lengths along u and v.
pub fn sheet(b: &mut Builder, size_m: [f64; 2], at: impl Fn(f64, f64) -> DVec3) {
    b.surface(divisions(b, size_m), at);
}

/// A bent board: the surface `at(u, v)` and its copy moved by `offset`, joined along the rim.
pub fn board(b: &mut Builder, size_m: [f64; 2], offset: DVec3, at: impl Fn(f64, f64) -> DVec3) {
    sheet(b, size_m, &at);
    sheet(b, size_m, |u, v| at(1.0 - u, v) + offset);
    let thickness_m = offset.length();
    let [length_u, length_v] = size_m;
    sheet(b, [length_u, thickness_m], |u, t| at(1.0 - u, 0.0) + t * offset);
    sheet(b, [length_u, thickness_m], |u, t| at(u, 1.0) + t * offset);
    sheet(b, [length_v, thickness_m], |v, t| at(0.0, v) + t * offset);
    sheet(b, [length_v, thickness_m], |v, t| at(1.0, 1.0 - v) + t * offset);
}

/// Bent sheets need a few segments; rims need only one.
fn divisions(b: &Builder, size_m: [f64; 2]) -> [usize; 2] {
    let [short, long] = [size_m[0].min(size_m[1]), size_m[0].max(size_m[1])];
    let least = if short < 0.1 * long { [1, 6] } else { [3, 6] };
    let wide = size_m[0] >= size_m[1];
    let [least_u, least_v] = if wide { [least[1], least[0]] } else { least };
    [b.curved(size_m[0], least_u), b.curved(size_m[1], least_v)]
}
