//! The height of the ground in a coarse polar grid around the sensor, above a plane.

use std::f32::consts::{PI, TAU};

use crate::angle::atan2;
use crate::plane::Plane;

/// The number of sectors, of two degrees each: ten columns of 0.2 degrees.
pub const SECTORS: usize = 180;
/// The number of range bins, from 1 m on, eight in each doubling of the range: like a sensor's
/// rings on flat ground, they widen with the range.
const BINS: usize = 64;
/// Shifts the bits of an f32 so that they count eighths of octaves.
const SHIFT: u32 = 20;
const FIRST: u32 = 1.0f32.to_bits() >> SHIFT;

/// The fewest ground points that give a height: a single one may be an outlier.
const FEWEST_POINTS: f32 = 2.0;
/// How far a mean may lie above the lower envelope: a kerb.
const STEP_M: f32 = 0.15;
/// The widest gap between heights that is filled.
const WIDEST_GAP_M: f32 = 15.0;

/// The ground in one bin of a sector: a mean of ground points, or interpolated. `height_m` is NaN
/// where it is unknown.
#[derive(Clone, Copy)]
struct Cell {
    range_m: f32,
    height_m: f32,
}

#[derive(Clone, Copy, Default)]
struct Sum {
    position: [f32; 3],
    count: f32,
}

impl Sum {
    fn mean(&self) -> Option<[f32; 3]> {
        (self.count >= FEWEST_POINTS).then(|| self.position.map(|sum| sum / self.count))
    }
}

/// The grid. In each sector, heights are interpolated over the range.
#[derive(Default)]
pub struct HeightGrid {
    plane: Plane,
    cells: Vec<Cell>,
    sums: Vec<Sum>,
    envelope: Vec<f32>,
}

impl HeightGrid {
    pub fn reset(&mut self) {
        self.cells.clear();
        self.sums.clear();
        self.sums.resize(SECTORS * BINS, Sum::default());
    }

    pub fn add(&mut self, sector: usize, range_m: f32, position: [f32; 3]) {
        let sum = &mut self.sums[sector * BINS + bin(range_m)];
        (0..3).for_each(|axis| sum.position[axis] += position[axis]);
        sum.count += 1.0;
    }

    /// The means of the points within `farthest_m`, cell by cell.
    pub fn means(&self, farthest_m: f32) -> impl Iterator<Item = [f32; 3]> {
        let sectors = self.sums.chunks_exact(BINS);
        let near = sectors.flat_map(move |sums| &sums[..=bin(farthest_m)]);
        near.filter_map(|sum| sum.mean())
    }

    /// Computes heights above `plane` from the points, drops those that are steeper than `slope`,
    /// and fills gaps.
    pub fn finish(&mut self, plane: Plane, slope: f32) {
        self.plane = plane;
        let cells = self.sums.iter().enumerate().map(|(at, sum)| match sum.mean() {
            None => Cell { range_m: middle_m(at % BINS), height_m: f32::NAN },
            Some(mean) => {
                let [x, y, _] = mean;
                Cell { range_m: (x * x + y * y).sqrt(), height_m: plane.height_m(mean) }
            }
        });
        self.cells.extend(cells);
        self.lower_envelope(slope);
        for (cell, low) in self.cells.iter_mut().zip(&self.envelope) {
            if cell.height_m > low + STEP_M {
                cell.height_m = f32::NAN;
            }
        }
        for sector in 0..SECTORS {
            self.fill(BINS, |bin| sector * BINS + bin, |cell, _| cell.range_m);
        }
        for bin in 0..BINS {
            let arc_m = middle_m(bin) * TAU / SECTORS as f32;
            // Twice around, so that a gap may lie behind the sensor.
            self.fill(
                2 * SECTORS,
                |sector| sector % SECTORS * BINS + bin,
                |_, sector| sector as f32 * arc_m,
            );
        }
        self.extend();
    }

    /// Computes the lower envelope: at each cell, the least of all cells' heights plus `slope`
    /// times their distance.
    fn lower_envelope(&mut self, slope: f32) {
        self.envelope.clear();
        let known =
            |cell: &Cell| if cell.height_m.is_nan() { f32::INFINITY } else { cell.height_m };
        self.envelope.extend(self.cells.iter().map(known));
        let forth = (0..SECTORS).chain(0..SECTORS);
        let back = (0..SECTORS).rev().chain((0..SECTORS).rev());
        for (sector, before) in forth
            .map(|sector| (sector, (sector + SECTORS - 1) % SECTORS))
            .chain(back.map(|sector| (sector, (sector + 1) % SECTORS)))
        {
            for bin in 0..BINS {
                let beside = self.envelope[before * BINS + bin];
                let climb = slope * middle_m(bin) * TAU / SECTORS as f32;
                let low = &mut self.envelope[sector * BINS + bin];
                *low = low.min(beside + climb);
            }
            let bins = &mut self.envelope[sector * BINS..][..BINS];
            for bin in 1..BINS {
                bins[bin] = bins[bin].min(bins[bin - 1] + slope * step_m(bin));
            }
            for bin in (1..BINS).rev() {
                bins[bin - 1] = bins[bin - 1].min(bins[bin] + slope * step_m(bin));
            }
        }
    }

    /// Interpolates between known heights along a line of `n` cells, given the index of each in the
    /// grid and its position along the line.
    fn fill(
        &mut self,
        n: usize,
        place: impl Fn(usize) -> usize,
        along_m: impl Fn(&Cell, usize) -> f32,
    ) {
        let mut known: Option<usize> = None;
        for here in 0..n {
            if self.cells[place(here)].height_m.is_nan() {
                continue;
            }
            if let Some(before) = known.filter(|before| before + 1 < here) {
                let from = along_m(&self.cells[place(before)], before);
                let gap = along_m(&self.cells[place(here)], here) - from;
                let (low, high) =
                    (self.cells[place(before)].height_m, self.cells[place(here)].height_m);
                if gap <= WIDEST_GAP_M {
                    for between in before + 1..here {
                        let share = (along_m(&self.cells[place(between)], between) - from) / gap;
                        self.cells[place(between)].height_m = low + share * (high - low);
                    }
                }
            }
            known = Some(here);
        }
    }

    /// Extends each sector's first height to the sensor, and its last one by two bins.
    fn extend(&mut self) {
        for cells in self.cells.chunks_exact_mut(BINS) {
            let is_known = |cell: &Cell| !cell.height_m.is_nan();
            if let Some(first) = cells.iter().position(is_known) {
                let height_m = cells[first].height_m;
                cells[..first].iter_mut().for_each(|cell| cell.height_m = height_m);
            }
            if let Some(last) = cells.iter().rposition(is_known) {
                let height_m = cells[last].height_m;
                cells[last + 1..].iter_mut().take(2).for_each(|cell| cell.height_m = height_m);
            }
        }
    }

    /// The height above the plane at `range_m` within `sector`; NaN where it is unknown.
    fn height(&self, sector: usize, range_m: f32) -> f32 {
        let cells = &self.cells[sector * BINS..][..BINS];
        let bin = bin(range_m);
        let here = cells[bin];
        let other = if range_m < here.range_m { bin.saturating_sub(1) } else { bin + 1 };
        match cells.get(other) {
            Some(other) if other.range_m != here.range_m && !other.height_m.is_nan() => {
                let share = (range_m - here.range_m) / (other.range_m - here.range_m);
                here.height_m + share.clamp(0.0, 1.0) * (other.height_m - here.height_m)
            }
            _ => here.height_m,
        }
    }

    /// The height above the ground of a point in `sector` at `range_m`; NaN where the ground is
    /// unknown.
    pub fn above_ground_m(&self, sector: usize, range_m: f32, position: [f32; 3]) -> f32 {
        self.plane.height_m(position) - self.height(sector, range_m)
    }

    /// The ground's z at `(x, y)`, if it is known.
    pub fn z_m(&self, x: f32, y: f32) -> Option<f32> {
        let range_m = libm::hypotf(x, y);
        if self.cells.is_empty() || !range_m.is_finite() {
            return None;
        }
        let sector = ((atan2(y, x) + PI) * (SECTORS as f32 / TAU)) as usize;
        let height_m = self.height(sector.min(SECTORS - 1), range_m);
        (!height_m.is_nan()).then(|| self.plane.z_m(x, y) + height_m)
    }
}

/// The bin of a range: eight bins of equal width between powers of two.
fn bin(range_m: f32) -> usize {
    let eighths = range_m.max(1.0).to_bits() >> SHIFT;
    ((eighths - FIRST) as usize).min(BINS - 1)
}

fn edge_m(bin: usize) -> f32 {
    f32::from_bits((bin as u32 + FIRST) << SHIFT)
}

fn middle_m(bin: usize) -> f32 {
    (edge_m(bin) + edge_m(bin + 1)) / 2.0
}

/// From the middle of the bin before to the middle of `bin`.
fn step_m(bin: usize) -> f32 {
    middle_m(bin) - middle_m(bin - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_eighths_of_octaves() {
        assert_eq!(
            [0.0, 1.0, 1.124, 1.126, 2.0, 15.9, 16.0, 1e9].map(bin),
            [0, 0, 0, 1, 8, 31, 32, 63]
        );
        assert_eq!([edge_m(0), edge_m(8), edge_m(9)], [1.0, 2.0, 2.25]);
    }

    /// A grid with ground points at these sectors, ranges and heights.
    fn grid(seen: &[(usize, f32, f32)]) -> HeightGrid {
        let mut grid = HeightGrid::default();
        grid.reset();
        for &(sector, range_m, z) in seen {
            let (sin, cos) = ((sector as f32 + 0.5) / SECTORS as f32 * TAU - PI).sin_cos();
            (0..2).for_each(|_| grid.add(sector, range_m, [range_m * cos, range_m * sin, z]));
        }
        grid.finish(Plane::level(-0.5), 0.3);
        grid
    }

    #[test]
    fn heights_are_interpolated_along_a_sector_and_across_sectors() {
        let grid = grid(&[(90, 8.5, -2.0), (90, 12.5, -1.0), (93, 12.5, -1.0)]);
        let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-5, "{found}");
        near(grid.height(90, 10.5), -1.0);
        near(grid.height(90, 3.0), -1.5);
        near(grid.height(91, 12.5), -0.5);
        near(grid.above_ground_m(91, 12.5, [12.5, 0.5, 1.0]), 2.0);
        near(grid.z_m(12.5, 0.1).unwrap(), -1.0);
        assert_eq!(grid.z_m(-12.5, 0.0), None);
        assert_eq!(grid.z_m(f32::NAN, 0.0), None);
    }

    #[test]
    fn one_point_gives_no_height() {
        let mut grid = HeightGrid::default();
        grid.reset();
        grid.add(90, 10.5, [10.5, 0.0, -2.0]);
        assert_eq!(grid.means(20.0).count(), 0);
        grid.finish(Plane::level(-0.5), 0.3);
        assert!(grid.height(90, 10.5).is_nan());
    }

    #[test]
    fn gaps_of_up_to_15_m_are_filled_and_two_bins_behind_the_last() {
        let known = |seen: &[(usize, f32, f32)], range_m| !grid(seen).height(90, range_m).is_nan();
        assert!(known(&[(90, 20.5, -2.0), (90, 34.5, -1.0)], 28.5));
        assert!(!known(&[(90, 20.5, -2.0), (90, 38.5, -1.0)], 28.5));
        // Bins are 1 m wide here.
        assert!(known(&[(90, 11.5, -2.0)], 13.4) && !known(&[(90, 11.5, -2.0)], 14.6));
    }

    /// Between sectors at 10.5 m lie 0.3665 m, over which ground climbs by 0.3 times that, and a
    /// kerb of 0.15 m besides.
    #[test]
    fn ground_means_may_rise_by_a_kerb_and_the_slope() {
        for (low, high, sectors) in
            [(89, 90, 1.0), (91, 90, 1.0), (80, 90, 10.0), (176, 3, 7.0), (3, 176, 7.0)]
        {
            let most_m = 0.15 + 0.3 * 0.3665 * sectors;
            let is_ground = |rise_m: f32| {
                let grid = grid(&[(low, 10.5, -2.0), (high, 10.5, -2.0 + rise_m)]);
                (grid.height(high, 10.5) - (rise_m - 1.5)).abs() < 1e-3
            };
            assert!(is_ground(most_m - 0.01), "{low} {high}");
            assert!(!is_ground(most_m + 0.01), "{low} {high}");
        }
        // Along a sector, from 10.5 to 14.5 m.
        let rises = |rise_m: f32| {
            let grid = grid(&[(90, 10.5, -2.0), (90, 14.5, -2.0 + rise_m)]);
            (grid.height(90, 14.5) - (rise_m - 1.5)).abs() < 1e-3
        };
        assert!(rises(0.15 + 1.19) && !rises(0.15 + 1.21));
        // What lies lower, as in a hole, is ground.
        assert!(rises(-1.0));
    }
}
