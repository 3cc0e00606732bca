//! The size of an object seen from above, and its match with a cluster.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The difference between two measurements of a side: metres, plus a share of the side.
const SIZE_OFF_M: f64 = 0.2;
const SIZE_OFF_SHARE: f64 = 0.3;
/// A side that is measured shorter decays by 1 % per turn, so that a size that merging with a
/// neighbour inflated does not persist.
const SHRINKAGE: f64 = 0.99;
/// The largest hidden part of a side, metres: most of a car's length.
const MOST_HIDDEN_M: f64 = 4.0;

/// A cluster for the tracker.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    pub time_s: f64,
    /// The middle of its box, metres, in a fixed frame.
    pub position_m: [f64; 3],
    /// Length and width of its box, metres.
    pub size_m: [f64; 2],
    /// The direction of the length, radians counterclockwise from x.
    pub yaw_rad: f64,
    /// The position of the sensor, metres.
    pub sensor_m: [f64; 2],
    /// The log-probability of each class, if it has enough points for one.
    pub view: Option<&'a [f64]>,
    /// The length of the whole object that was seen in it, metres.
    pub whole_length_m: Option<f32>,
}

/// The size of an object seen from above, from all of its clusters.
#[derive(Clone, Copy, Debug, Default)]
pub struct Footprint {
    /// The direction of the first side, radians counterclockwise from x.
    pub yaw_rad: f64,
    /// Its two sides, metres.
    pub sides_m: [f64; 2],
}

impl Footprint {
    /// The sides of the measured box, in the order of this footprint's sides, and the direction of
    /// the first.
    fn sides_of(&self, seen: &Observation<'_>) -> ([f64; 2], f64) {
        let [length, width] = seen.size_m;
        let turned = (seen.yaw_rad - self.yaw_rad + FRAC_PI_4).rem_euclid(PI);
        match turned < FRAC_PI_2 {
            true => ([length, width], seen.yaw_rad),
            false => ([width, length], seen.yaw_rad + FRAC_PI_2),
        }
    }

    /// The middle of the whole object, whose hidden parts lie behind the visible ones.
    pub fn middle(&self, seen: &Observation<'_>) -> [f64; 3] {
        let (sides, yaw_rad) = self.sides_of(seen);
        let mut middle = seen.position_m;
        let (sin, cos) = libm::sincos(yaw_rad);
        for (i, [x, y]) in [[cos, sin], [-sin, cos]].into_iter().enumerate() {
            let hidden_m = (self.sides_m[i] - sides[i]).clamp(0.0, MOST_HIDDEN_M);
            let [dx, dy] = [0, 1].map(|axis| seen.position_m[axis] - seen.sensor_m[axis]);
            let away_m = (hidden_m / 2.0).copysign(dx * x + dy * y);
            middle[0] += away_m * x;
            middle[1] += away_m * y;
        }
        middle
    }

    /// The mismatch of the measured size: the sum of the squared differences of the sides, in units
    /// of the usual difference between two measurements of one object.
    pub fn mismatch(&self, seen: &Observation<'_>) -> f64 {
        let (sides, _) = self.sides_of(seen);
        let term = |i: usize| {
            let larger = sides[i].max(self.sides_m[i]);
            ((sides[i] - self.sides_m[i]) / (SIZE_OFF_M + SIZE_OFF_SHARE * larger)).powi(2)
        };
        term(0) + term(1)
    }

    pub fn update(&mut self, seen: &Observation<'_>) {
        let (sides, yaw_rad) = self.sides_of(seen);
        let grown = |i: usize| sides[i].max(SHRINKAGE * self.sides_m[i]);
        *self = Self { yaw_rad, sides_m: [grown(0), grown(1)] };
    }
}
