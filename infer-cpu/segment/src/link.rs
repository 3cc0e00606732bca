//! Links neighbours in the range image that are near each other.

use std::ops::RangeInclusive;

use crate::image::{Cells, Return};
use crate::settings::Settings;

/// On a surface at 30 degrees to the beams, rings are twice as far apart as on a perpendicular one.
const SLANT: f32 = 2.0;
/// The least angle between two rings, in radians: a third of a degree, the finest of a VLP-32C.
/// Rows of two stacked sensors lie closer together and are treated as this far apart.
const LEAST_PITCH: f32 = 0.0058;
/// Rings farther apart than this (three quarters of a degree), such as a VLP-32C's lowest, are
/// linked over more height but not over more horizontal distance, which would link objects side by
/// side.
const MOST_PITCH: f32 = 0.0131;
/// The heights above the ground at which car windows begin. Roofs are higher, so that branches
/// above them are not linked as the far side of a window is.
const BELT_M: RangeInclusive<f32> = 0.6..=1.3;
/// The most columns that are searched for a neighbour: 8 degrees.
pub const MOST_COLUMNS: usize = 40;
/// The most returns of one cell that are compared. Two sensors with four rings in a row's height
/// and two returns in a column's width have that many. The limit bounds the time for clouds with
/// all points in one cell.
pub const MOST_IN_CELL: usize = 16;

pub trait Links {
    fn join(&mut self, a: u32, b: u32);
}

/// Joins all returns of `column` with their neighbours: in the column itself, in the next and the
/// previous one, and, along a row, in columns of higher numbers.
pub fn link_column(image: &impl Cells, column: usize, settings: &Settings, links: &mut impl Links) {
    let mut linker = Linker { image, links, limits: Limits::new(settings) };
    for row in 0..image.elevations().len() {
        let cell = image.cell(column, row);
        for (at, this) in cell.iter().enumerate() {
            let others = &cell[at + 1..];
            linker.join_near(this, others, within(linker.limits.reach_m));
            linker.look_aside(this, column, row);
            linker.look_up(this, column, row);
        }
    }
}

/// The distances within which returns are linked.
struct Limits {
    /// The width of a column, radians.
    column_width: f32,
    reach_m: f32,
    bridge_m: f32,
}

impl Limits {
    fn new(settings: &Settings) -> Self {
        let column_width = settings.column_width_deg.to_radians();
        Self { column_width, reach_m: settings.reach_m, bridge_m: settings.bridge_m }
    }

    /// The largest distance between neighbours on a row at a horizontal distance from the sensor,
    /// and the number of columns that it spans.
    fn aside(&self, range_m: f32) -> (f32, usize) {
        let spacing_m = range_m * self.column_width;
        let limit_m = self.reach_m + spacing_m;
        (limit_m, ((limit_m / spacing_m) as usize).clamp(1, MOST_COLUMNS))
    }
}

struct Linker<'a, I, L> {
    image: &'a I,
    links: &'a mut L,
    limits: Limits,
}

impl<I: Cells, L: Links> Linker<'_, I, L> {
    /// Links `this` to the next near return on its row, past columns that are empty or whose
    /// returns lie in front or behind.
    fn look_aside(&mut self, this: &Return, column: usize, row: usize) {
        let (limit_m, most) = self.limits.aside(this.range_m);
        let n_columns = self.image.n_columns();
        let mut beside = column;
        for _ in 0..most.min(n_columns - 1) {
            beside = if beside + 1 == n_columns { 0 } else { beside + 1 };
            if self.join_near(this, self.image.cell(beside, row), within(limit_m)) {
                return;
            }
        }
    }

    /// Links `this` to the next near return above it, past rows without one. From a car's belt
    /// line, the search spans the height of a window.
    fn look_up(&mut self, this: &Return, column: usize, row: usize) {
        let elevations = self.image.elevations();
        if row + 1 == elevations.len() {
            return;
        }
        let n_columns = self.image.n_columns();
        let columns = [column, (column + 1) % n_columns, (column + n_columns - 1) % n_columns];
        let elevation = elevations[row];
        let pitch = (elevations[row + 1] - elevation).max(LEAST_PITCH);
        let Limits { reach_m, bridge_m, .. } = self.limits;
        let limit_m = reach_m + SLANT * this.range_m * pitch.min(MOST_PITCH);
        let height_m = reach_m + SLANT * this.range_m * pitch;
        let is_belt = BELT_M.contains(&this.height_m);
        let bridged_m = if is_belt { bridge_m.max(height_m) } else { height_m };
        let highest = elevation + bridged_m / this.range_m;
        let is_linked = |flat: f32, dz: f32| within(limit_m)(flat, dz * limit_m / bridged_m);
        for (above, &beam) in elevations.iter().enumerate().skip(row + 1) {
            if beam > highest {
                return;
            }
            let mut is_near = false;
            for column in columns {
                let cell = self.image.cell(column, above);
                is_near |= self.join_near(this, cell, is_linked);
            }
            if is_near {
                return;
            }
        }
    }

    /// Links `this` to the `others` that `is_near` accepts, given the squared horizontal distance
    /// and the difference in height. Returns whether there are any.
    fn join_near(
        &mut self,
        this: &Return,
        others: &[Return],
        is_near: impl Fn(f32, f32) -> bool,
    ) -> bool {
        let mut any = false;
        for other in others.iter().take(MOST_IN_CELL) {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| other.position[axis] - this.position[axis]);
            if is_near(dx * dx + dy * dy, dz) {
                self.links.join(this.point, other.point);
                any = true;
            }
        }
        any
    }
}

/// A test whether a distance is at most `limit_m`.
fn within(limit_m: f32) -> impl Fn(f32, f32) -> bool {
    move |flat, dz| flat + dz * dz <= limit_m * limit_m
}
