//! Links neighbours in the range image that are near each other.

use std::ops::{Range, RangeInclusive};

use crate::image::{RangeImage, Return};
use crate::sets::Sets;
use crate::settings::Settings;

/// On a surface at 30 degrees to the beams, rings are twice as far apart as on one
/// across them.
const SLANT: f32 = 2.0;
/// The least elevation between two rings of one sensor that links: a third of a
/// degree, a VLP-32C's finest. Rows of two stacked sensors lie closer together.
const LEAST_PITCH: f32 = 0.0058;
/// Rings farther apart than this, three quarters of a degree, such as a VLP-32C's
/// lowest, may be linked over more height, but not over more ground: that would link
/// what stands side by side.
const MOST_PITCH: f32 = 0.0131;
/// Windows of cars begin at such heights above the ground; roofs are higher, so that
/// the branches over them are not linked like the other side of a window.
const BELT_M: RangeInclusive<f32> = 0.6..=1.3;
/// The most columns that are searched for a neighbour: 8 degrees.
const MOST_COLUMNS: usize = 40;
/// The most returns of one cell that are compared. Two sensors with four rings in
/// a row's height and two returns in a column's width have as many; it bounds the
/// time for clouds with all points in one cell.
const MOST_IN_CELL: usize = 16;

/// Joins the sets of all returns that belong together.
pub fn link(image: &RangeImage, settings: &Settings, sets: &mut Sets) {
    let mut linker = Linker {
        image,
        sets,
        column_width: settings.column_width_deg.to_radians(),
        reach_m: settings.reach_m,
        bridge_m: settings.bridge_m,
    };
    for column in 0..image.n_columns() {
        for row in 0..image.n_rows() {
            let cell = image.cell(column, row);
            for at in cell.clone() {
                let this = image.returns(at..at + 1)[0];
                linker.join_near(&this, at + 1..cell.end, within(linker.reach_m));
                linker.look_aside(&this, column, row);
                linker.look_up(&this, column, row);
            }
        }
    }
}

struct Linker<'a> {
    image: &'a RangeImage,
    sets: &'a mut Sets,
    column_width: f32,
    reach_m: f32,
    bridge_m: f32,
}

impl Linker<'_> {
    /// Links `this` to the next return on its row that is near, past missing ones
    /// and past things in front or behind.
    fn look_aside(&mut self, this: &Return, column: usize, row: usize) {
        let spacing_m = this.range_m * self.column_width;
        let limit_m = self.reach_m + spacing_m;
        let n_columns = self.image.n_columns();
        let most = ((limit_m / spacing_m) as usize).clamp(1, MOST_COLUMNS.min(n_columns - 1));
        let mut beside = column;
        for _ in 0..most {
            beside = if beside + 1 == n_columns { 0 } else { beside + 1 };
            if self.join_near(this, self.image.cell(beside, row), within(limit_m)) {
                return;
            }
        }
    }

    /// Links `this` to the next return above it that is near, past rows without one.
    /// Above a car's belt line, that is as far as a window is high.
    fn look_up(&mut self, this: &Return, column: usize, row: usize) {
        let n_rows = self.image.n_rows();
        if row + 1 == n_rows {
            return;
        }
        let n_columns = self.image.n_columns();
        let columns = [column, (column + 1) % n_columns, (column + n_columns - 1) % n_columns];
        let elevation = self.image.elevation(row);
        let pitch = (self.image.elevation(row + 1) - elevation).max(LEAST_PITCH);
        let limit_m = self.reach_m + SLANT * this.range_m * pitch.min(MOST_PITCH);
        let height_m = self.reach_m + SLANT * this.range_m * pitch;
        let is_belt = BELT_M.contains(&this.height_m);
        let bridged_m = if is_belt { self.bridge_m.max(height_m) } else { height_m };
        let highest = elevation + bridged_m / this.range_m;
        let is_linked = |flat: f32, dz: f32| within(limit_m)(flat, dz * limit_m / bridged_m);
        for above in row + 1..n_rows {
            if self.image.elevation(above) > highest {
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

    /// Links `this` to those returns at `places` of which `is_near` is true, given the
    /// square of their horizontal distance and their difference in height, and says
    /// whether there are any.
    fn join_near(
        &mut self,
        this: &Return,
        places: Range<usize>,
        is_near: impl Fn(f32, f32) -> bool,
    ) -> bool {
        let mut any = false;
        for other in self.image.returns(places).iter().take(MOST_IN_CELL) {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| other.position[axis] - this.position[axis]);
            if is_near(dx * dx + dy * dy, dz) {
                self.sets.join(this.point, other.point);
                any = true;
            }
        }
        any
    }
}

/// Whether a distance is at most `limit_m`.
fn within(limit_m: f32) -> impl Fn(f32, f32) -> bool {
    move |flat, dz| flat + dz * dz <= limit_m * limit_m
}
