//! An order of rays in which neighbours point in neighbouring directions.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

/// The plane of azimuth and elevation is cut into 2^BITS cells across its
/// width of a full circle: 0.0055 degrees, finer than any beam spacing.
const BITS: u32 = 16;

/// All indices of `directions` along a Hilbert curve over azimuth and
/// elevation. The curve never jumps, so each run of it is a compact patch
/// whatever the spacing of the rings. Ties keep firing order.
pub(super) fn coherent_order(directions: &[DVec3]) -> Vec<u32> {
    let mut keyed: Vec<u64> = directions.iter().zip(0u32..).map(|(&d, i)| key(d, i)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|key| key as u32).collect()
}

/// The place on the curve in the high half, the ray in the low half.
fn key(direction: DVec3, ray: u32) -> u64 {
    let azimuth_rad = direction.y.atan2(direction.x);
    let elevation_rad = direction.z.clamp(-1.0, 1.0).asin();
    let cell = |angle_rad: f64| {
        let cells = f64::from(1u32 << BITS);
        (angle_rad / TAU * cells).clamp(0.0, cells - 1.0) as u32
    };
    let place = hilbert_index(cell(azimuth_rad + PI), cell(elevation_rad + FRAC_PI_2));
    u64::from(place) << 32 | u64::from(ray)
}

/// The index of cell (x, y) on the Hilbert curve of 2^BITS x 2^BITS cells
/// (Warren, Hacker's Delight, 2nd edition, section 16-2: one quadrant a bit).
fn hilbert_index(mut x: u32, mut y: u32) -> u32 {
    let mut index = 0;
    for bit in (0..BITS).rev() {
        let (in_x, in_y) = (x >> bit & 1, y >> bit & 1);
        index = index << 2 | (3 * in_x) ^ in_y;
        if in_y == 0 {
            if in_x == 1 {
                x = !x;
                y = !y;
            }
            (x, y) = (y, x);
        }
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_each_cell_once_by_single_steps() {
        let last_bits = 4;
        let side = 1 << last_bits;
        let mut cells: Vec<(u32, u32, u32)> = (0..side * side)
            .map(|i| (i % side, i / side))
            .map(|(x, y)| (hilbert_index(x, y), x, y))
            .collect();
        cells.sort_unstable();
        for pair in cells.windows(2) {
            let [(index, x, y), (next_index, next_x, next_y)] = [pair[0], pair[1]];
            assert_eq!(next_index, index + 1);
            assert_eq!(x.abs_diff(next_x) + y.abs_diff(next_y), 1);
        }
    }

    #[test]
    fn poles_and_seam_have_a_place() {
        for direction in [DVec3::Z, DVec3::NEG_Z, DVec3::NEG_X, DVec3::new(-1.0, -0.0, 0.0)] {
            assert_eq!(key(direction, 7) as u32, 7);
        }
    }
}
