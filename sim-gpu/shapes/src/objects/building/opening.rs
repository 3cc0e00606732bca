//! A part of a wall, with or without a window or a door.

use crate::primitives::{Builder, DVec2, DVec3, block, dvec3};

/// An upright rectangle across x, in (y, z).
#[derive(Clone, Copy)]
pub struct Rect {
    pub low: DVec2,
    pub high: DVec2,
}

impl Rect {
    /// The corners at this x, counter-clockwise as seen from +x.
    fn corners(self, x: f64) -> Vec<DVec3> {
        let [low, high] = [self.low, self.high];
        [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)]
            .map(|(y, z)| dvec3(x, y, z))
            .to_vec()
    }

    /// The rectangle without a border of `by_m`.
    pub fn shrunk(self, by_m: f64) -> Self {
        Self { low: self.low + by_m, high: self.high - by_m }
    }

    pub fn middle(self) -> DVec2 {
        (self.low + self.high) / 2.0
    }

    pub fn size_m(self) -> DVec2 {
        self.high - self.low
    }
}

#[derive(Clone, Copy, PartialEq)]
pub enum Filling {
    Glass,
    Panes,
    /// A door, a roller blind, or a curtain behind the glass.
    Solid,
}

#[derive(Clone, Copy)]
pub struct Opening {
    pub hole: Rect,
    /// The distance of the filling behind the face of the wall.
    pub recess_m: f64,
    pub frame_m: f64,
    pub filling: Filling,
}

/// Adds a wall without an opening, which faces +x at x = 0.
pub fn blank(b: &mut Builder, cell: Rect) {
    let [low, high] = [cell.low, cell.high];
    let row = |z: f64| vec![dvec3(0.0, low.x, z), dvec3(0.0, high.x, z)];
    b.grid(&[row(low.y), row(high.y)], false);
}

impl Opening {
    /// Adds the wall of `cell` around the hole, the reveals, the frame and the filling.
    pub fn build(self, b: &mut Builder, cell: Rect) {
        let inner = self.hole.shrunk(self.frame_m);
        let [outside, inside] = [self.hole, inner].map(|rect| rect.corners(-self.recess_m));
        b.grid(&[cell.corners(0.0), self.hole.corners(0.0), outside, inside.clone()], true);
        let middle = inner.middle();
        let centre = dvec3(-self.recess_m, middle.x, middle.y);
        let pane = [inside, vec![centre]];
        match self.filling {
            Filling::Solid => b.grid(&pane, true),
            Filling::Glass => b.glass(|b| b.grid(&pane, true)),
            Filling::Panes => {
                b.glass(|b| b.grid(&pane, true));
                block(b, centre, dvec3(0.05, 0.08, inner.size_m().y));
            }
        }
    }
}
