//! The shell of a bus or of a lorry's cab: walls with wheel arches, panes and doors around a
//! rectangular plan with a bowed front, and a roof.

use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};

use crate::objects::car::panel::{Arch, Column, in_order, lid, lower_edge_m, wall};
use crate::primitives::Builder;

/// A shell from `rear_x` to `front_x`. All lengths are metres.
pub struct Shell {
    pub rear_x: f64,
    pub front_x: f64,
    pub half_width_m: f64,
    /// The heights of the lower edge, of the windows' lower edge and of the roof.
    pub sill_m: f64,
    pub waist_m: f64,
    pub roof_m: f64,
    /// The height of the windows' upper edge.
    pub lintel_m: f64,
    pub arches: Vec<Arch>,
    /// The distance of the windscreen's upper edge behind its lower edge.
    pub rake_m: f64,
    /// How far the middle of the front stands out.
    pub bow_m: f64,
    /// How far the walls lean in.
    pub inset_m: f64,
    /// The intervals of x that have windows, on both sides.
    pub windows: Vec<Range<f64>>,
    /// The side with doors (-1 right, 1 left) and the intervals of x that have doors. Doors are
    /// panes that begin near the ground.
    pub doors: (f64, Vec<Range<f64>>),
    pub has_rear_window: bool,
    pub has_windscreen: bool,
}

impl Shell {
    pub fn build(&self, b: &mut Builder) {
        for side in [-1.0, 1.0] {
            b.place(DAffine3::from_scale(dvec3(1.0, -side, 1.0)), |b| self.half(b, side));
        }
        let edge = self.plan().into_iter().map(|p| self.head(p)).collect::<Vec<_>>();
        lid(b, &edge, 0.06);
    }

    /// The right half from the middle of the rear to the middle of the front, with the doors of
    /// `side`.
    fn half(&self, b: &mut Builder, side: f64) {
        let plan = self.plan();
        let lower: Vec<_> = plan.iter().map(|&p| self.lower(p, side)).collect();
        let upper: Vec<_> = plan.iter().map(|&p| self.upper(p)).collect();
        wall(b, &lower);
        wall(b, &upper);
    }

    /// The outline of the right half: x, and y (negative or 0).
    fn plan(&self) -> Vec<DVec2> {
        let y = self.half_width_m;
        let doors = self.doors.1.iter();
        let ends = doors.chain(&self.windows).flat_map(|range| [range.start, range.end]);
        let arches = self.arches.iter().flat_map(Arch::stations);
        let inner = [self.rear_x + 0.13, self.front_x - self.bow_m - 0.13];
        let corners = [self.rear_x + 0.12, self.front_x - self.bow_m - 0.12];
        let mut plan = vec![
            dvec2(self.rear_x, 0.0),
            dvec2(self.rear_x + 0.02, 0.12 - y),
            dvec2(corners[0], -y),
        ];
        plan.extend(in_order(ends.chain(arches), inner).into_iter().map(|x| dvec2(x, -y)));
        plan.extend([
            dvec2(corners[1], -y),
            dvec2(self.front_x - self.bow_m, 0.1 - y),
            dvec2(self.front_x - 0.3 * self.bow_m, -0.5 * y),
            dvec2(self.front_x, 0.0),
        ]);
        plan
    }

    fn is_front(&self, p: DVec2) -> bool {
        p.x >= self.front_x - self.bow_m - 1e-9
    }

    fn lower(&self, p: DVec2, side: f64) -> Column {
        let foot = p.extend(lower_edge_m(&self.arches, self.sill_m, p.x).min(self.waist_m - 0.02));
        let on_side = p.y <= 1e-9 - self.half_width_m;
        let is_door = on_side && self.doors.0 == side && within(&self.doors.1, p.x);
        Column { foot, head: self.waist(p), pane: is_door.then_some([0.08, 1.0]) }
    }

    fn upper(&self, p: DVec2) -> Column {
        let share = (self.lintel_m - self.waist_m) / (self.roof_m - self.waist_m);
        let on_side = p.y <= 1e-9 - self.half_width_m;
        let is_pane = if on_side {
            within(&self.windows, p.x) || within(&self.doors.1, p.x)
        } else if self.is_front(p) {
            self.has_windscreen
        } else {
            self.has_rear_window && p.x < self.rear_x + 0.01
        };
        Column { foot: self.waist(p), head: self.head(p), pane: is_pane.then_some([0.0, share]) }
    }

    fn waist(&self, p: DVec2) -> DVec3 {
        p.extend(self.waist_m)
    }

    /// The upper end of the wall over `p`.
    fn head(&self, p: DVec2) -> DVec3 {
        // The rake begins behind the front corners and increases to the front.
        let reach_m = 3.0 * self.rake_m + 0.2;
        let forward = ((p.x - self.front_x + reach_m) / reach_m).clamp(0.0, 1.0);
        let y = p.y * (1.0 - self.inset_m / self.half_width_m);
        dvec3(p.x - self.rake_m * forward, y, self.roof_m)
    }
}

/// Whether a pane begins at `x` or contains it.
fn within(ranges: &[Range<f64>], x: f64) -> bool {
    ranges.iter().any(|range| (range.start - 0.005..range.end - 0.011).contains(&x))
}
