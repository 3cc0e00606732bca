//! Connected components: points in one component are linked by steps of at most a radius.

use std::cmp::Ordering;
use std::ops::Range;

use crate::label::Label;
use crate::link::Links;
use crate::sets::Sets;

/// The cells of a cubic grid, and scratch memory.
#[derive(Default)]
pub struct Components {
    points: Vec<Placed>,
    cells: Vec<Cell>,
}

/// A point and its cell's coordinates: whole numbers, which f64 holds for any f32.
#[derive(Clone, Copy)]
struct Placed {
    cell: [f64; 3],
    point: u32,
}

struct Cell {
    at: [f64; 3],
    /// Its points, as places in the sorted ones.
    points: Range<usize>,
}

/// The edge of a cell as a share of the radius, just below 1/√3: even after rounding, the diagonal
/// is shorter than the radius, so that all points of a cell belong to one component.
const EDGE: f64 = 0.577_35;
/// Points within the radius lie at most this many cells apart along each axis.
const FARTHEST: f64 = 2.0;

impl Components {
    /// Joins the sets of all points that are at most `radius_m` apart; points with a coordinate
    /// that is not finite become [`Label::Invalid`].
    pub fn join(
        &mut self,
        points: &[[f32; 3]],
        radius_m: f32,
        labels: &mut [Label],
        sets: &mut Sets,
    ) {
        self.sort(points, f64::from(radius_m) * EDGE, labels);
        for cell in &self.cells {
            let members = &self.points[cell.points.clone()];
            members.windows(2).for_each(|pair| sets.join(pair[0].point, pair[1].point));
        }
        // Half of the neighbourhood suffices: the cells of the other half visit this one.
        for dy in [0.0, 1.0, 2.0] {
            self.join_columns(points, radius_m, [0.0, dy], sets);
        }
        for dx in [1.0, 2.0] {
            for dy in [-2.0, -1.0, 0.0, 1.0, 2.0] {
                self.join_columns(points, radius_m, [dx, dy], sets);
            }
        }
    }

    fn sort(&mut self, points: &[[f32; 3]], edge_m: f64, labels: &mut [Label]) {
        self.points.clear();
        for (point, position) in points.iter().enumerate() {
            let is_valid = position.iter().all(|x| x.is_finite());
            labels[point] = if is_valid { Label::OBSTACLE } else { Label::Invalid };
            if is_valid {
                // Adding 0 turns -0 into 0, which is the same cell.
                let cell = position.map(|x| (f64::from(x) / edge_m).floor() + 0.0);
                self.points.push(Placed { cell, point: point as u32 });
            }
        }
        self.points.sort_unstable_by(|a, b| order(a.cell, b.cell).then(a.point.cmp(&b.point)));
        self.cells.clear();
        let mut start = 0;
        for members in self.points.chunk_by(|a, b| a.cell == b.cell) {
            let end = start + members.len();
            self.cells.push(Cell { at: members[0].cell, points: start..end });
            start = end;
        }
    }

    /// Joins each cell with those `[dx, dy]` beside it, up to two cells higher or lower. The cells
    /// are sorted, so that one pass finds all pairs.
    fn join_columns(
        &self,
        points: &[[f32; 3]],
        radius_m: f32,
        [dx, dy]: [f64; 2],
        sets: &mut Sets,
    ) {
        let mut others = 0;
        for cell in &self.cells {
            let [x, y, z] = cell.at;
            let lowest = [x + dx, y + dy, z - FARTHEST];
            let highest = [x + dx, y + dy, z + FARTHEST];
            while self.cells.get(others).is_some_and(|other| order(other.at, lowest).is_lt()) {
                others += 1;
            }
            for other in &self.cells[others..] {
                if order(other.at, highest).is_gt() {
                    break;
                }
                self.join_cells(points, radius_m, cell, other, sets);
            }
        }
    }

    /// Joins two cells if any two of their points are near enough.
    fn join_cells(&self, points: &[[f32; 3]], radius_m: f32, a: &Cell, b: &Cell, sets: &mut Sets) {
        let [first, second] = [a, b].map(|cell| &self.points[cell.points.clone()]);
        if sets.first(first[0].point) == sets.first(second[0].point) {
            return;
        }
        let radius_squared = f64::from(radius_m).powi(2);
        let is_near = |a: &Placed, b: &Placed| {
            let [a, b] = [a, b].map(|placed| points[placed.point as usize].map(f64::from));
            (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>() <= radius_squared
        };
        if first.iter().any(|a| second.iter().any(|b| is_near(a, b))) {
            sets.join(first[0].point, second[0].point);
        }
    }
}

fn order(a: [f64; 3], b: [f64; 3]) -> Ordering {
    (0..3).map(|axis| a[axis].total_cmp(&b[axis])).fold(Ordering::Equal, Ordering::then)
}
