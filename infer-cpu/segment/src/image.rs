//! A sweep as an image: a row for each ring, columns of equal azimuth.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::angle::atan2;
use crate::label::Label;
use crate::settings::{MOST_ROWS, Settings};
use crate::sweep::{SegmentError, Sweep};

/// A point, with its position relative to the sensor and to the ground.
#[derive(Clone, Copy, Default)]
pub struct Return {
    pub position: [f32; 3],
    /// Horizontal distance from the sensor in metres.
    pub range_m: f32,
    /// Height above the ground in metres, NaN while it is unknown.
    pub height_m: f32,
    /// The point's index in the sweep.
    pub point: u32,
}

/// A range image, column by column.
pub trait Columns {
    fn n_columns(&self) -> usize;
    /// The returns of a column from the lowest row up.
    fn column(&self, column: usize) -> &[Return];
}

/// A range image, cell by cell.
pub trait Cells {
    fn n_columns(&self) -> usize;
    /// The elevation of each row in radians, ascending.
    fn elevations(&self) -> &[f32];
    fn cell(&self, column: usize, row: usize) -> &[Return];
}

/// The returns of a sweep, sorted by column and then by row. A cell holds any number of them: rings
/// of two sensors or beams between two columns share cells.
#[derive(Default)]
pub struct RangeImage {
    n_columns: usize,
    /// The elevation of each row in radians, ascending.
    elevations: Vec<f32>,
    /// The start of each cell's returns, then the end of the last cell's.
    starts: Vec<u32>,
    returns: Vec<Return>,
    spots: Vec<Spot>,
    rows: Vec<RingSums>,
    order: Vec<u32>,
}

/// Where a point belongs: its column, and its ring or its step in elevation.
#[derive(Clone, Copy)]
struct Spot {
    column: u16,
    ring: u16,
    range_m: f32,
}

/// The column of points that are in no cell.
const NOWHERE: u16 = u16::MAX;

/// Sums over a ring's returns: their quotient is the tangent of its elevation.
#[derive(Clone, Copy, Default)]
struct RingSums {
    range_m: f64,
    z_m: f64,
    number: u32,
}

impl RangeImage {
    /// Sorts `sweep` into the image. Points in the image get the label [`Label::OBSTACLE`], others
    /// [`Label::Small`] or [`Label::Invalid`].
    pub fn fill(
        &mut self,
        sweep: &Sweep<'_>,
        settings: &Settings,
        labels: &mut [Label],
    ) -> Result<(), SegmentError> {
        self.n_columns = n_columns(settings);
        self.place(sweep, settings, labels);
        self.number_rows(settings.ring_elevations_deg.as_deref())?;
        self.sort(sweep.points);
        Ok(())
    }

    /// Finds the column and the ring of every point.
    fn place(&mut self, sweep: &Sweep<'_>, settings: &Settings, labels: &mut [Label]) {
        let per_row = 1.0 / settings.row_height_deg.to_radians();
        let squares = settings.min_range_m.powi(2)..=settings.max_range_m.powi(2);
        let rings = sweep.distinct_rings();
        self.spots.clear();
        self.rows.clear();
        for (point, &[x, y, z]) in sweep.points.iter().enumerate() {
            let flat = x * x + y * y;
            let square = flat + z * z;
            let mut spot = Spot { column: NOWHERE, ring: 0, range_m: flat.sqrt() };
            if !squares.contains(&square) || square == 0.0 {
                let is_valid = square > 0.0 && [x, y, z].iter().all(|x| x.is_finite());
                labels[point] = if is_valid { Label::Small } else { Label::Invalid };
                self.spots.push(spot);
                continue;
            }
            labels[point] = Label::OBSTACLE;
            spot.column = column(self.n_columns, x, y);
            spot.ring = match rings {
                Some(rings) => rings[point],
                None => ((atan2(z, spot.range_m) + FRAC_PI_2) * per_row) as u16,
            };
            if self.rows.len() <= usize::from(spot.ring) {
                self.rows.resize(usize::from(spot.ring) + 1, RingSums::default());
            }
            let row = &mut self.rows[usize::from(spot.ring)];
            row.range_m += f64::from(spot.range_m);
            row.z_m += f64::from(z);
            self.spots.push(spot);
        }
    }

    /// Numbers the rings by elevation, which need not be the order of the sensor's lasers. The
    /// rings are those of `elevations_deg`, or else those that have returns.
    fn number_rows(&mut self, elevations_deg: Option<&[f32]>) -> Result<(), SegmentError> {
        let is_used = |row: &RingSums| row.range_m != 0.0 || row.z_m != 0.0;
        self.order.clear();
        match elevations_deg {
            Some(known) if known.len() < self.rows.len() => {
                let (expected, found) = (known.len(), self.rows.len() - 1);
                return Err(SegmentError::UnknownRing { expected, found });
            }
            Some(known) => {
                self.rows.resize(known.len(), RingSums::default());
                self.order.extend(0..known.len() as u32);
            }
            None => {
                let used = self.rows.iter().enumerate().filter(|(_, row)| is_used(row));
                self.order.extend(used.map(|(ring, _)| ring as u32));
            }
        }
        if self.order.len() > MOST_ROWS {
            return Err(SegmentError::TooManyRings { most: MOST_ROWS, found: self.order.len() });
        }
        let mean = |row: &RingSums| atan2(row.z_m as f32, row.range_m as f32);
        let elevation = |ring: u32| match elevations_deg {
            Some(known) => known[ring as usize].to_radians(),
            None => mean(&self.rows[ring as usize]),
        };
        self.order.sort_unstable_by(|&a, &b| elevation(a).total_cmp(&elevation(b)).then(a.cmp(&b)));
        self.elevations.clear();
        self.elevations.extend(self.order.iter().map(|&ring| elevation(ring)));
        for (number, &ring) in self.order.iter().enumerate() {
            self.rows[ring as usize].number = number as u32;
        }
        Ok(())
    }

    /// Sorts the points by cell with a counting sort; points of one cell keep their order.
    fn sort(&mut self, points: &[[f32; 3]]) {
        let Self { n_columns, elevations, starts, returns, spots, rows, .. } = self;
        let n_rows = elevations.len();
        let cell = |spot: &Spot| {
            let row = rows[usize::from(spot.ring)].number as usize;
            usize::from(spot.column) * n_rows + row
        };
        starts.clear();
        starts.resize(*n_columns * n_rows + 1, 0);
        let placed = |spot: &Spot| spot.column != NOWHERE;
        spots.iter().filter(|spot| placed(spot)).for_each(|spot| starts[cell(spot)] += 1);
        let mut end = 0;
        for start in starts.iter_mut() {
            end += *start;
            *start = end;
        }
        returns.clear();
        returns.resize(end as usize, Return::default());
        for (point, spot) in spots.iter().enumerate().rev().filter(|(_, spot)| placed(spot)) {
            let start = &mut starts[cell(spot)];
            *start -= 1;
            returns[*start as usize] = Return {
                position: points[point],
                range_m: spot.range_m,
                height_m: f32::NAN,
                point: point as u32,
            };
        }
    }

    fn n_rows(&self) -> usize {
        self.elevations.len()
    }

    /// Removes the returns that `is_kept`, given their column, rejects.
    pub fn retain(&mut self, mut is_kept: impl FnMut(usize, &mut Return) -> bool) {
        let (mut kept, mut from) = (0, 0);
        for column in 0..self.n_columns {
            for row in 0..self.n_rows() {
                let cell = column * self.n_rows() + row;
                let to = self.starts[cell + 1] as usize;
                self.starts[cell] = kept as u32;
                for at in from..to {
                    let mut this = self.returns[at];
                    let is_kept = is_kept(column, &mut this);
                    self.returns[kept] = this;
                    kept += usize::from(is_kept);
                }
                from = to;
            }
        }
        if let Some(end) = self.starts.last_mut() {
            *end = kept as u32;
        }
        self.returns.truncate(kept);
    }
}

impl Columns for RangeImage {
    fn n_columns(&self) -> usize {
        self.n_columns
    }

    fn column(&self, column: usize) -> &[Return] {
        let cell = column * self.n_rows();
        &self.returns[self.starts[cell] as usize..self.starts[cell + self.n_rows()] as usize]
    }
}

impl Cells for RangeImage {
    fn n_columns(&self) -> usize {
        self.n_columns
    }

    fn elevations(&self) -> &[f32] {
        &self.elevations
    }

    fn cell(&self, column: usize, row: usize) -> &[Return] {
        let cell = column * self.n_rows() + row;
        &self.returns[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

pub fn n_columns(settings: &Settings) -> usize {
    (360.0 / settings.column_width_deg).round() as usize
}

/// The column, of `n_columns`, in which a return at `(x, y)` lies: counterclockwise from behind the
/// sensor.
pub fn column(n_columns: usize, x: f32, y: f32) -> u16 {
    let column = (atan2(y, x) + PI) * (n_columns as f32 / (2.0 * PI));
    (column as u16).min(n_columns as u16 - 1)
}
