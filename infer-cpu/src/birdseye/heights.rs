//! The height of the ground in square cells of a metre, everywhere around the sensor.

use edgepuck_segment::Label;

/// The length of a cell, and how far the cells reach, metres.
const CELL_M: f32 = 1.0;
const REACH_M: f32 = 46.0;
pub const N: usize = (2.0 * REACH_M / CELL_M) as usize;

/// The ground: in each cell the median of its ground points, or that of the nearest cell that has some.
pub struct Heights {
    z_m: Vec<f32>,
}

impl Heights {
    /// The ground among `points`; `None` if there is none within reach.
    pub fn of(points: &[[f32; 3]], labels: &[Label]) -> Option<Self> {
        let mut by_cell: Vec<(usize, f32)> = points
            .iter()
            .zip(labels)
            .filter(|(_, label)| **label == Label::Ground)
            .filter_map(|(&[x, y, z], _)| Some((index(x)? * N + index(y)?, z)))
            .collect();
        by_cell.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut z_m = vec![f32::NAN; N * N];
        for cell in by_cell.chunk_by(|a, b| a.0 == b.0) {
            z_m[cell[0].0] = cell[cell.len() / 2].1;
        }
        let in_row: Vec<_> = (0..N * N).map(|cell| nearest_in_row(&z_m, cell)).collect();
        let filled = (0..N * N).map(|cell| Some(z_m[nearest(&in_row, cell)?]));
        Some(Self { z_m: filled.collect::<Option<_>>()? })
    }

    /// The height of the ground at (x, y), metres in the sensor's frame.
    pub fn z_m(&self, [x, y]: [f32; 2]) -> f32 {
        self.z_m[nearest_index(x) * N + nearest_index(y)]
    }
}

/// The row or column of the cells at `along_m`; `None` beyond them.
pub fn index(along_m: f32) -> Option<usize> {
    let cell = ((along_m + REACH_M) / CELL_M).floor();
    (0.0..N as f32).contains(&cell).then_some(cell as usize)
}

/// The same; beyond the cells, the nearest.
pub fn nearest_index(along_m: f32) -> usize {
    ((along_m + REACH_M) / CELL_M).clamp(0.0, (N - 1) as f32) as usize
}

/// The column of the nearest known cell of the same row, the left one of two.
fn nearest_in_row(z_m: &[f32], cell: usize) -> Option<usize> {
    let (row, column) = (cell / N, cell % N);
    let is_known = |&column: &usize| !z_m[row * N + column].is_nan();
    let left = (0..=column).rev().find(is_known);
    let right = (column..N).find(is_known);
    [left, right].into_iter().flatten().min_by_key(|found| found.abs_diff(column))
}

/// The nearest known cell, by the distance of the middles, given that of each row. Of several, that in
/// the smallest square about the cell counts, and of these the first.
fn nearest(in_row: &[Option<usize>], cell: usize) -> Option<usize> {
    let (row, column) = (cell / N, cell % N);
    let mut best: Option<(usize, usize, usize)> = None;
    for away in 0..N {
        // No cell of these rows or beyond is nearer.
        if best.is_some_and(|(square, ..)| square < away * away) {
            break;
        }
        for i in [row.checked_sub(away), Some(row + away)].into_iter().flatten() {
            if let Some(j) = in_row.get(i * N + column).copied().flatten() {
                let aside = j.abs_diff(column);
                let found = (away * away + aside * aside, away.max(aside), i * N + j);
                best = Some(best.map_or(found, |best| best.min(found)));
            }
        }
    }
    best.map(|(_, _, found)| found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_the_median_of_their_ground_or_that_of_the_nearest() {
        let ground = [[0.5, 0.5, -1.0], [0.6, 0.4, -3.0], [0.2, 0.9, -2.0], [10.5, 0.5, 4.0]];
        let points = [&ground[..], &[[5.5, 0.5, 9.0], [0.5, 50.0, 9.0]]].concat();
        let mut labels = [Label::Ground; 6];
        labels[4] = Label::Small;
        let heights = Heights::of(&points, &labels).unwrap();
        let expected =
            [([0.1, 0.1], -2.0), ([4.9, 0.5], -2.0), ([6.1, 0.5], 4.0), ([-45.0, 45.9], -2.0)];
        for (at, z_m) in expected {
            assert_eq!(heights.z_m(at), z_m, "{at:?}");
        }
        // (3, 3) is nearer than (0, 5), although its ring is the same or farther.
        let near = [[3.5, 3.5, 1.0], [0.5, 5.5, 2.0]];
        assert_eq!(Heights::of(&near, &[Label::Ground; 2]).unwrap().z_m([0.5, 0.5]), 1.0);
        assert!(Heights::of(&points[4..], &labels[4..]).is_none());
    }

    #[test]
    fn points_far_away_have_the_ground_at_the_edge() {
        let heights = Heights::of(&[[45.9, -45.9, 7.0], [0.0; 3]], &[Label::Ground; 2]).unwrap();
        assert_eq!(heights.z_m([1e9, -1e9]), 7.0);
    }

    /// Both cells are five away, and both squares are as large.
    #[test]
    fn of_cells_that_are_as_near_the_first_counts() {
        let ground = [[0.5, 5.5, 1.0], [-4.5, 0.5, 2.0]];
        let heights = Heights::of(&ground, &[Label::Ground; 2]).unwrap();
        assert_eq!(heights.z_m([0.5, 0.5]), 2.0);
    }
}
