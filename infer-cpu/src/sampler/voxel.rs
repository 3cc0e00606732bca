//! Voxel grid sampling: one point for each occupied cell of a cubic grid.

use super::canonical::{compare, sort_by_geometry};
use super::hash::Map;

/// The finest cell size: each f32 number then has a cell of its own.
const FINEST: f64 = f32::from_bits(1) as f64;

/// The sizes in a search for a grid: each octave is divided into this number of equal steps.
const STEPS_AN_OCTAVE: u32 = 32;

/// The search covers these octaves from twice the cloud's extent down, beyond the resolution of
/// f64.
const OCTAVES: u32 = 63;

/// Offsets from a cell's corner are integers in this number of parts of the edge: `u32::MAX` of
/// them sum to less than 2^64.
const PARTS: f64 = 4_294_967_296.0;

/// Thins clouds, and reuses its memory for each. The memory grows with the number of occupied
/// cells, not of points.
#[derive(Default)]
pub struct VoxelGrid {
    cells: Vec<Cell>,
    /// The index in `cells` of each cell, by the bits of its low corner in units of the edge.
    index: Map<[u64; 3]>,
    /// Sort keys of the kept points.
    keys: Vec<u64>,
}

/// Cubes of edge `size`, one of which has its low corner at `origin`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    origin: [f64; 3],
    size: f64,
}

/// An occupied cell.
struct Cell {
    /// The number of points in the cell.
    n: u32,
    /// The sum of their offsets from the low corner, in parts of the edge.
    sum: [u64; 3],
    /// The point nearest to the centroid so far.
    nearest: u32,
    /// Its squared distance from the centroid, in parts of the edge.
    distance: f64,
}

impl VoxelGrid {
    /// Writes one point of each cell of edge `size` (positive and finite, in the units of the
    /// cloud) to `out`: the one nearest to the centroid of the cell's points. Cells begin at
    /// coordinate 0 in every cloud.
    ///
    /// Points are ascending by x, y, z. They are the same for any order of the input: offsets are
    /// summed as integers in 2⁻³² of the edge, the least point wins a tie, and the first of equal
    /// points is kept.
    pub fn select_by_size(&mut self, points: &[[f32; 3]], size: f64, out: &mut Vec<u32>) {
        self.select(points, &Grid { origin: [0.0; 3], size: size.max(FINEST) }, out);
    }

    /// Does the same for the finest grid with at most `m` (at least 1) occupied cells. Cells begin
    /// at the cloud's least coordinates, in f64.
    ///
    /// A cloud of up to `m` distinct points keeps all of them. For others, a bisection searches
    /// edges in steps of 1.6 to 3.1 %, from twice the cloud's extent down to 2⁻⁶³ of it: the result
    /// has at most `m` occupied cells, and the next finer edge has more. (A much finer edge may
    /// have fewer again, since grids of different edges are not nested.)
    pub fn select_by_count(&mut self, points: &[[f32; 3]], m: usize, out: &mut Vec<u32>) {
        let grid = self.finest(points, m);
        self.select(points, &grid, out);
    }

    fn finest(&mut self, points: &[[f32; 3]], m: usize) -> Grid {
        let every_point = Grid { origin: [0.0; 3], size: FINEST };
        // Each distinct point has a cell of its own in this grid.
        if self.occupies_at_most(m, points, &every_point) {
            return every_point;
        }
        let (low, extent) = bounds(points);
        let grid = |step| Grid { origin: low, size: extent * edge(step) };
        let mut fits = 0;
        let mut too_fine = OCTAVES * STEPS_AN_OCTAVE;
        // The count of cells need not be monotonic: the invariant is that `fits` fits and
        // `too_fine` does not.
        while too_fine - fits > 1 {
            let middle = fits.midpoint(too_fine);
            if self.occupies_at_most(m, points, &grid(middle)) {
                fits = middle;
            } else {
                too_fine = middle;
            }
        }
        grid(fits)
    }

    /// Whether the points lie in at most `m` cells; stops at the first cell beyond.
    fn occupies_at_most(&mut self, m: usize, points: &[[f32; 3]], grid: &Grid) -> bool {
        self.clear();
        points.iter().all(|point| {
            self.cell(grid.place(point));
            self.cells.len() <= m
        })
    }

    fn select(&mut self, points: &[[f32; 3]], grid: &Grid, out: &mut Vec<u32>) {
        self.clear();
        for point in points {
            let place = grid.place(point);
            let offset = grid.offset(point, place);
            let cell = self.cell(place);
            cell.n += 1;
            (0..3).for_each(|axis| cell.sum[axis] += offset[axis]);
        }
        // Centroids are complete only after the first pass, so distances need a second one.
        for (i, point) in points.iter().enumerate() {
            let place = grid.place(point);
            let offset = grid.offset(point, place);
            let cell = self.cell(place);
            let distance = cell.distance_from_centroid(offset);
            let is_nearer = distance < cell.distance
                || distance == cell.distance
                    && compare(point, &points[cell.nearest as usize]).is_lt();
            if is_nearer {
                cell.distance = distance;
                cell.nearest = i as u32;
            }
        }
        self.keys.clear();
        self.keys.extend(self.cells.iter().map(|cell| u64::from(cell.nearest)));
        sort_by_geometry(&mut self.keys, points);
        out.clear();
        out.extend(self.keys.iter().map(|&key| key as u32));
    }

    fn clear(&mut self) {
        self.cells.clear();
        self.index.clear();
    }

    /// The cell at `place`, which is added if it is new.
    fn cell(&mut self, place: [f64; 3]) -> &mut Cell {
        let n = self.cells.len() as u32;
        // f64 has no hash, but its bits have.
        let at = *self.index.entry(place.map(f64::to_bits)).or_insert(n);
        if at == n {
            self.cells.push(Cell { n: 0, sum: [0; 3], nearest: 0, distance: f64::INFINITY });
        }
        &mut self.cells[at as usize]
    }
}

impl Grid {
    /// The cell of a point. Adding 0 removes the sign of a zero, which would give other bits.
    fn place(&self, point: &[f32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.edges(point, axis).floor() + 0.0)
    }

    /// The offset of a point from its cell's low corner, in parts of the edge.
    fn offset(&self, point: &[f32; 3], place: [f64; 3]) -> [u64; 3] {
        [0, 1, 2].map(|axis| ((self.edges(point, axis) - place[axis]) * PARTS) as u64)
    }

    fn edges(&self, point: &[f32; 3], axis: usize) -> f64 {
        (f64::from(point[axis]) - self.origin[axis]) / self.size
    }
}

impl Cell {
    fn distance_from_centroid(&self, offset: [u64; 3]) -> f64 {
        let from_mean =
            |axis: usize| offset[axis] as f64 - self.sum[axis] as f64 / f64::from(self.n);
        let [dx, dy, dz] = [0, 1, 2].map(from_mean);
        (dx * dx + dy * dy) + dz * dz
    }
}

/// The cloud's least coordinates and its longest side.
fn bounds(points: &[[f32; 3]]) -> ([f64; 3], f64) {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let low = low.map(f64::from);
    let sides = [0, 1, 2].map(|axis| f64::from(high[axis]) - low[axis]);
    (low, sides.into_iter().fold(0.0, f64::max))
}

/// The edge at a step of the search, as a multiple of the cloud's extent: 2 at step 0. All are
/// powers of two times integer fractions, and so the same on any machine.
fn edge(step: u32) -> f64 {
    let octave = 2.0 / (1u64 << (step / STEPS_AN_OCTAVE)) as f64;
    octave * f64::from(2 * STEPS_AN_OCTAVE - step % STEPS_AN_OCTAVE)
        / f64::from(2 * STEPS_AN_OCTAVE)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{any_cloud, extremes, gather, shuffled, uniform};
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    fn by_size(points: &[[f32; 3]], size: f64) -> Vec<u32> {
        let mut out = vec![];
        VoxelGrid::default().select_by_size(points, size, &mut out);
        out
    }

    fn by_count(points: &[[f32; 3]], m: usize) -> Vec<u32> {
        let mut out = vec![];
        VoxelGrid::default().select_by_count(points, m, &mut out);
        out
    }

    #[test]
    fn a_cell_keeps_the_point_nearest_to_its_centroid() {
        // Centroids at 0.4 and -0.55; cells begin at 0.
        let along_x = [0.1, 0.3, 0.8, -0.1, -0.6, -0.95];
        let cloud = along_x.map(|x| [x, 0.5, 0.5]);
        assert_eq!(by_size(&cloud, 1.0), [4, 1]);
        // The lesser of two points at the same distance.
        let cloud = [0.75, 0.25].map(|x| [x, 0.5, 0.5]);
        assert_eq!(by_size(&cloud, 1.0), [1]);
    }

    fn n_occupied(points: &[[f32; 3]], grid: &Grid) -> usize {
        let cells = points.iter().map(|point| grid.place(point).map(f64::to_bits));
        cells.collect::<HashSet<_>>().len()
    }

    #[test]
    fn a_grid_by_count_is_the_last_of_the_search_that_fits() {
        let square: Vec<_> = (0..16u8).map(|i| [f32::from(i / 4), f32::from(i % 4), 0.0]).collect();
        for cloud in [square, uniform(1024, 4)] {
            let (low, extent) = bounds(&cloud);
            for m in 1..cloud.len().min(200) {
                let found = VoxelGrid::default().finest(&cloud, m);
                let mut steps = 0..OCTAVES * STEPS_AN_OCTAVE;
                let step = steps.find(|&step| extent * edge(step) == found.size).unwrap();
                let next = Grid { origin: low, size: extent * edge(step + 1) };
                let (n, n_next) = (n_occupied(&cloud, &found), n_occupied(&cloud, &next));
                assert!(n <= m && n_next > m, "{n} and {n_next} for {m}");
                assert_eq!(by_count(&cloud, m).len(), n);
            }
        }
    }

    #[test]
    fn extremes_keep_every_distinct_point_that_they_may() {
        for (what, cloud, n_distinct) in extremes() {
            assert_eq!(by_count(&cloud, 1000).len(), n_distinct, "{what}");
            assert_eq!(by_size(&cloud, 1e-300).len(), n_distinct, "{what}");
            assert_eq!(by_count(&cloud, 1).len(), n_distinct.min(1), "{what}");
            // Octants, however large the cells.
            assert!(by_size(&cloud, 1e300).len() <= 8, "{what}");
        }
    }

    #[test]
    fn an_outlier_leaves_the_others_their_cells() {
        let cloud = [uniform(999, 1), vec![[1e9, 0.0, 0.0]]].concat();
        let kept = by_size(&cloud, 0.5);
        assert_eq!(kept.len(), 4 * 4 * 4 + 1);
        assert_eq!(kept.last(), Some(&999));
        let n = by_count(&cloud, 64).len();
        assert!((48..=64).contains(&n), "{n}");
    }

    #[test]
    fn edges_of_the_search_descend_in_small_steps() {
        for step in 0..OCTAVES * STEPS_AN_OCTAVE {
            let ratio = edge(step + 1) / edge(step);
            assert!((1.0 - 1.0 / 32.0..=1.0 - 1.0 / 64.0).contains(&ratio), "{step}: {ratio}");
        }
        assert_eq!(edge(0), 2.0);
        assert_eq!(edge(OCTAVES * STEPS_AN_OCTAVE), 2f64.powi(-62));
    }

    #[test]
    fn ten_million_points_take_the_memory_of_their_cells() {
        // An emulator gets a tenth of the points, which occupy as many cells.
        let n = if test_support::IS_EMULATED { 1_000_000 } else { 10_000_000 };
        let cloud = uniform(n, 5);
        let mut grid = VoxelGrid::default();
        let mut kept = vec![];
        grid.select_by_size(&cloud, 0.2, &mut kept);
        assert_eq!(kept.len(), 1000);
        assert!(grid.cells.capacity() <= 1024 && grid.index.capacity() <= 2048);
        grid.select_by_count(&cloud[..1_000_000], 1000, &mut kept);
        assert!(kept.len() <= 1000);
        assert!(grid.cells.capacity() <= 1024 && grid.index.capacity() <= 2048);
    }

    proptest! {
        #[test]
        fn each_occupied_cell_keeps_one_point(cloud in any_cloud(), size in 0.05f64..3.0) {
            let cell = |point: &[f32; 3]| point.map(|x| ((f64::from(x) / size).floor() + 0.0).to_bits());
            let occupied: HashSet<_> = cloud.iter().map(cell).collect();
            let kept = by_size(&cloud, size);
            let cells: HashSet<_> = gather(&cloud, &kept).iter().map(cell).collect();
            prop_assert_eq!(kept.len(), cells.len());
            prop_assert_eq!(cells, occupied);
        }

        #[test]
        fn at_most_m_points_are_kept_and_all_if_no_more_are_there(
            cloud in any_cloud(), m in 1usize..100,
        ) {
            let kept = by_count(&cloud, m);
            prop_assert!(kept.len() <= m);
            let distinct: HashSet<_> = cloud.iter().map(|p| p.map(|x| (x + 0.0).to_bits())).collect();
            if distinct.len() <= m {
                prop_assert_eq!(kept.len(), distinct.len());
            }
        }

        #[test]
        fn the_order_of_the_input_does_not_matter(
            cloud in any_cloud(), seed in any::<u32>(), m in 1usize..30, size in 0.05f64..3.0,
        ) {
            let shuffled = shuffled(&cloud, seed);
            prop_assert_eq!(
                gather(&cloud, &by_count(&cloud, m)),
                gather(&shuffled, &by_count(&shuffled, m))
            );
            prop_assert_eq!(
                gather(&cloud, &by_size(&cloud, size)),
                gather(&shuffled, &by_size(&shuffled, size))
            );
        }
    }
}
