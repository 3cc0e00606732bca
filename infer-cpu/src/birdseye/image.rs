//! A sweep seen from above: which heights over the ground are occupied in each cell.

use edgepuck_segment::Label;

use super::heights::Heights;

/// The length of a cell, and how far the image reaches, metres.
pub const CELL_M: f32 = 0.2;
pub const REACH_M: f32 = 40.0;
/// Points farther away than this are not seen, metres: the network was trained without them.
pub const FARTHEST_M: f32 = 44.0;
/// The cells along one side.
pub const SIDE: usize = (2.0 * REACH_M / CELL_M) as usize;

/// The borders of the heights over the ground, metres.
const BORDERS_M: [f32; 10] = [0.2, 0.4, 0.65, 0.9, 1.15, 1.4, 1.65, 1.9, 2.3, 3.0];
const N_HEIGHTS: usize = BORDERS_M.len() + 1;
/// The channel of ground; those before are the heights in the four quarters of a cell.
const GROUND: usize = 4 * N_HEIGHTS;
/// After it come the logarithm of the number of points, and the distance.
pub const CHANNELS: usize = GROUND + 3;
/// The least and the greatest height over the ground of a point that counts, metres.
const LOWEST_M: f32 = -0.6;
const HIGHEST_M: f32 = 5.0;

/// Where a coordinate is along a side, in cells; `None` beyond them.
pub fn cells_along(along_m: f32) -> Option<f32> {
    let cells = (along_m + REACH_M) / CELL_M;
    (0.0..SIDE as f32).contains(&cells).then_some(cells)
}

/// What is in a cell.
#[derive(Clone, Copy, Default, PartialEq)]
struct Cell {
    /// The channels that are 1.
    bits: u64,
    /// The number of points that are not ground.
    n_standing: u32,
}

/// The image of a sweep.
pub struct Image {
    cells: Vec<Cell>,
}

impl Image {
    /// The image of `points`, metres in the sensor's frame, above `ground`.
    pub fn new(points: &[[f32; 3]], labels: &[Label], ground: &Heights) -> Self {
        let mut cells = vec![Cell::default(); SIDE * SIDE];
        for (&[x, y, z], label) in points.iter().zip(labels) {
            let height_m = z - ground.z_m([x, y]);
            let is_seen = *label != Label::Invalid
                && height_m > LOWEST_M
                && height_m < HIGHEST_M
                && libm::hypotf(x, y) < FARTHEST_M;
            let (true, [Some(u), Some(v)]) = (is_seen, [x, y].map(cells_along)) else { continue };
            let cell = &mut cells[u as usize * SIDE + v as usize];
            if *label == Label::Ground {
                cell.bits |= 1 << GROUND;
            } else {
                let quarter = 2 * usize::from(u.fract() >= 0.5) + usize::from(v.fract() >= 0.5);
                let height = BORDERS_M.partition_point(|&border| border <= height_m);
                cell.bits |= 1 << (quarter * N_HEIGHTS + height);
                cell.n_standing += 1;
            }
        }
        Self { cells }
    }

    /// Whether nothing is in a cell.
    pub fn is_empty(&self, row: usize, column: usize) -> bool {
        self.cells[row * SIDE + column] == Cell::default()
    }

    /// Passes the channels of a cell that are not 0, and their values.
    pub fn channels(&self, row: usize, column: usize, mut each: impl FnMut(usize, f32)) {
        let cell = self.cells[row * SIDE + column];
        let mut bits = cell.bits;
        while bits != 0 {
            each(bits.trailing_zeros() as usize, 1.0);
            bits &= bits - 1;
        }
        if cell.n_standing > 0 {
            each(GROUND + 1, libm::log1pf(cell.n_standing as f32) / 4.0);
        }
        if cell.bits != 0 {
            let [x, y] = [row, column].map(|at| (at as f32 + 0.5) * CELL_M - REACH_M);
            each(GROUND + 2, libm::hypotf(x, y) / REACH_M);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(image: &Image, row: usize, column: usize) -> Vec<(usize, f32)> {
        let mut found = Vec::new();
        image.channels(row, column, |channel, value| found.push((channel, value)));
        found
    }

    /// Ground at -1.8 m. The cell of row 200 and column 250 begins at (0, 10) m, its quarters are 0.1 m wide.
    #[test]
    fn a_cell_has_its_heights_by_quarters_its_ground_its_number_and_its_distance() {
        let points = [
            ([0.05, 10.05, -1.8], Label::Ground),
            ([0.05, 10.05, -1.65], Label::Cluster(0)),
            ([0.05, 10.15, -1.55], Label::Small),
            ([0.15, 10.05, 1.0], Label::Cluster(0)),
            ([0.15, 10.15, 2.9], Label::Small),
            ([0.15, 10.15, 2.95], Label::Small),
            // Too high, too low, invalid, beyond the image, and too far away in a corner of it.
            ([0.05, 10.05, 3.3], Label::Small),
            ([0.05, 10.05, -2.5], Label::Small),
            ([0.05, 10.05, -1.0], Label::Invalid),
            ([40.1, 0.0, -1.0], Label::Small),
            ([0.0, -40.1, -1.0], Label::Small),
            ([33.0, 33.0, -1.0], Label::Small),
        ];
        let (points, labels): (Vec<_>, Vec<_>) = points.into_iter().unzip();
        let ground = Heights::of(&points, &labels).unwrap();
        let image = Image::new(&points, &labels, &ground);
        let number = 6f32.ln() / 4.0;
        let distance = 0.1f32.hypot(10.1) / 40.0;
        // Heights of 0.15, 0.25, 2.8 and 4.7 m: below 0.2, from there, from 2.3 and from 3.0 m on.
        let expected = [
            (0, 1.0),
            (N_HEIGHTS + 1, 1.0),
            (2 * N_HEIGHTS + 9, 1.0),
            (3 * N_HEIGHTS + 10, 1.0),
            (GROUND, 1.0),
            (GROUND + 1, number),
            (GROUND + 2, distance),
        ];
        let found = channels(&image, 200, 250);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-6, "{found:?}");
        }
        let is_full = |cell: &usize| !image.is_empty(cell / SIDE, cell % SIDE);
        assert_eq!((0..SIDE * SIDE).filter(is_full).collect::<Vec<_>>(), [200 * SIDE + 250]);
    }

    #[test]
    fn a_height_on_a_border_is_over_it() {
        for (over, border_m) in (1..).zip(BORDERS_M) {
            let points = [[0.05, 10.05, 0.0], [0.05, 10.05, border_m]];
            let labels = [Label::Ground, Label::Small];
            let image = Image::new(&points, &labels, &Heights::of(&points, &labels).unwrap());
            assert_eq!(channels(&image, 200, 250)[0], (over, 1.0), "{border_m}");
        }
    }

    #[test]
    fn the_far_edges_are_beyond_the_cells() {
        assert_eq!([-REACH_M, REACH_M].map(cells_along), [Some(0.0), None]);
        let points = [[0.5, 0.5, 0.0], [0.0, REACH_M, 1.0], [REACH_M, 0.0, 1.0]];
        let labels = [Label::Ground, Label::Small, Label::Small];
        let image = Image::new(&points, &labels, &Heights::of(&points, &labels).unwrap());
        let is_full = |cell: &usize| !image.is_empty(cell / SIDE, cell % SIDE);
        assert_eq!((0..SIDE * SIDE).filter(is_full).count(), 1);
    }
}
