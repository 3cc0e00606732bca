//! Open surfaces given by a function, without thickness or with.

use glam::DVec3;

use super::super::builder::Builder;

/// The surface `at(u, v)`, u and v in 0..=1, without thickness; `size_m` are
/// its rough lengths along u and v.
pub fn sheet(b: &mut Builder, size_m: [f64; 2], at: impl Fn(f64, f64) -> DVec3) {
    let [n_u, n_v] = divisions(b, size_m);
    let rows: Vec<Vec<DVec3>> = (0..=n_v)
        .map(|j| (0..=n_u).map(|i| at(i as f64 / n_u as f64, j as f64 / n_v as f64)).collect())
        .collect();
    b.grid(&rows, false);
}

/// The surface `at(u, v)` and its copy moved by `offset`, joined along the
/// rim: a bent board.
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

/// Bent sheets need a few segments to show their bend; rims need none.
fn divisions(b: &Builder, size_m: [f64; 2]) -> [usize; 2] {
    let [short, long] = [size_m[0].min(size_m[1]), size_m[0].max(size_m[1])];
    let least = if short < 0.1 * long { [1, 6] } else { [3, 6] };
    let wide = size_m[0] >= size_m[1];
    let [least_u, least_v] = if wide { [least[1], least[0]] } else { least };
    [b.curved(size_m[0], least_u), b.curved(size_m[1], least_v)]
}

#[cfg(test)]
mod tests {
    use super::super::measure::{area_m2, volume_m3};
    use super::*;

    #[test]
    fn a_flat_sheet_has_its_area_and_a_board_its_volume() {
        let flat = |u: f64, v: f64| DVec3::new(2.0 * u, 3.0 * v, 0.0);
        assert!((area_m2(0.5, |b| sheet(b, [2.0, 3.0], flat)) - 6.0).abs() < 1e-12);
        let down = DVec3::new(0.0, 0.0, -0.1);
        let volume = volume_m3(0.5, |b| board(b, [2.0, 3.0], down, flat));
        assert!((volume - 0.6).abs() < 1e-12, "{volume}");
    }
}
