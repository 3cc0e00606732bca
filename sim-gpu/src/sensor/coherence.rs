//! An order of rays in which neighbours point in neighbouring directions.

use std::f64::consts::TAU;

use glam::DVec3;

/// A square is cut into 2^BITS x 2^BITS cells: 0.01 degrees wide for a sensor
/// that spans 40 degrees, finer than any beam spacing.
const BITS: u32 = 12;
/// The most squares side by side around the horizon.
const MAX_SQUARES: f64 = 256.0;

/// All indices of `directions`, sorted along a chain of Hilbert curves. The strip between the
/// lowest and the highest elevation is cut into squares around the horizon, each with its own
/// curve. Each curve ends where the next begins, so that every run of the chain is a compact patch,
/// whatever the spacing of the rings. Ties keep firing order.
pub(super) fn coherent_order(directions: &[DVec3]) -> Vec<u32> {
    let angles_rad: Vec<[f64; 2]> = directions.iter().map(azimuth_elevation_rad).collect();
    let lowest = |axis: usize| angles_rad.iter().map(|a| a[axis]).fold(f64::INFINITY, f64::min);
    let highest_rad = angles_rad.iter().map(|a| a[1]).fold(f64::NEG_INFINITY, f64::max);
    let (first_rad, lowest_rad) = (lowest(0), lowest(1));
    let side_rad = (highest_rad - lowest_rad).max(TAU / MAX_SQUARES);

    let place = |[azimuth_rad, elevation_rad]: [f64; 2]| {
        let along = (azimuth_rad - first_rad) / side_rad;
        let square = along.floor().min(MAX_SQUARES - 1.0);
        let x = cell(along - square);
        let y = cell((elevation_rad - lowest_rad) / side_rad);
        (square as u32) << (2 * BITS) | hilbert_index(x, y)
    };
    let rays = angles_rad.into_iter().zip(0u32..);
    let mut keyed: Vec<u64> =
        rays.map(|(angles, ray)| u64::from(place(angles)) << 32 | u64::from(ray)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|key| key as u32).collect()
}

fn azimuth_elevation_rad(direction: &DVec3) -> [f64; 2] {
    [libm::atan2(direction.y, direction.x), libm::asin(direction.z.clamp(-1.0, 1.0))]
}

/// The cell at this part, 0 to 1, of the side of a square.
fn cell(part: f64) -> u32 {
    let cells = f64::from(1u32 << BITS);
    (part * cells).clamp(0.0, cells - 1.0) as u32
}

/// The index of cell (x, y) on the Hilbert curve of 2^BITS x 2^BITS cells, which begins at (0, 0)
/// and ends at (2^BITS - 1, 0). Each bit selects a quadrant and its orientation (Hilbert 1891;
/// Warren, Hacker's Delight, chapter 16).
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
        // The lowest 4 bits, an even number, form a curve by themselves.
        let side = 1 << 4;
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
    fn the_curve_begins_and_ends_at_the_foot_of_its_square() {
        let last = (1 << BITS) - 1;
        assert_eq!(hilbert_index(0, 0), 0);
        assert_eq!(hilbert_index(last, 0), u32::MAX >> (32 - 2 * BITS));
    }

    #[test]
    fn poles_seam_and_a_lone_ring_have_a_place() {
        let poles = [DVec3::Z, DVec3::NEG_Z, DVec3::NEG_X, DVec3::new(-1.0, -0.0, 0.0)];
        let mut order = coherent_order(&poles);
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 3]);
        let ring = [DVec3::Y, DVec3::X, DVec3::NEG_Y, DVec3::new(-1.0, -1e-9, 0.0)];
        assert_eq!(coherent_order(&ring), [3, 2, 1, 0]);
        assert!(coherent_order(&[]).is_empty());
    }
}
