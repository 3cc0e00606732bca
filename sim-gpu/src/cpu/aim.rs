//! Makes rays from a sensor's beams in whole numbers, whose arithmetic is exact, so that
//! every adapter makes the same rays. Twin of `shaders/aim.wgsl`.
//!
//! A ray must pass its object within the account of
//! [`DISPLACEMENT`](super::intersect::DISPLACEMENT), but an error of its direction grows with
//! the distance to the sensor. In a direction as f32 holds it, and over 128 unit
//! lengths, it would be 64 units of u = 2^-24. Here a component of the direction is off by
//! (2 sqrt(3) + 1) * 2^-31: beam and rotation are each rounded to a multiple of 2^-30, which
//! adds sqrt(3) * 2^-31 each, and so is what the rotation gives. Over the farthest distance
//! that makes 4.5u, and 1u for the start, which is rounded to a multiple of 2^-23. From there
//! the direction counts, now rounded to a multiple of 2^-24: 0.6u over each unit length.
//!
//! A ray starts before the bounding sphere, anywhere: no root is needed. Where the sphere's
//! chord is 2 sqrt(w) long, it starts h = 3/8 w + 11/16 before the chord's middle. This is at
//! least sqrt(w) + 1/48 (the tangent at 16/9 lies at 2/3), which leaves room for rounding:
//! `w` is off by less than 0.001. As the middle's distance from the centre squared is
//! r^2 - w, no start is farther than 1.87 from the centre, and the sphere's far side is at
//! most 3.55 away.

use glam::{DMat3, DVec3};

/// How far a sensor may be from an object's centre, unit lengths.
const FARTHEST: f64 = 128.0;

/// The largest bounding sphere that the account allows for: around a cube of side 2, with
/// what is added for rounding.
const LARGEST_RADIUS: f64 = 1.7321;

/// How far a map of directions may be from a rotation: what rounding to 2^-30 adds at most.
const LEAST_SKEW: f64 = 1.0 / (1 << 30) as f64;

/// 11/16 in units of 2^-20, see the module.
pub const BEFORE: i32 = 11 << 16;

/// How one sensor sees one object, in whole numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedFrame {
    /// The rows of the rotation from the sensor's frame, in units of 2^-30.
    pub turn: [[i32; 3]; 3],
    /// The sensor in the unit frame, in units of 2^-50.
    pub origin: [i64; 3],
    /// The bounding sphere's radius squared, less the sensor's distance from its centre
    /// squared, in units of 2^-40.
    pub reach: i64,
}

/// A ray in whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedRay {
    /// Where it starts, in units of 2^-23.
    pub origin: [i32; 3],
    /// Its direction, in units of 2^-24.
    pub direction: [i32; 3],
    /// Distance from the sensor to its start, in units of 2^-20.
    pub skipped: i32,
}

impl FixedFrame {
    /// The frame of a sensor at `origin`; `None` where whole numbers are not exact enough:
    /// where the object is unevenly scaled, or very far away.
    #[must_use]
    pub fn new(origin: DVec3, unit_from_sensor: &DMat3, radius: f64) -> Option<Self> {
        let columns = unit_from_sensor.to_cols_array_2d().map(DVec3::from_array);
        let squared = columns.map(DVec3::length_squared).iter().sum::<f64>() / 3.0;
        let turn = *unit_from_sensor * squared.sqrt().recip();
        let skew = turn.transpose() * turn - DMat3::IDENTITY;
        // A comparison with what is not a number is false.
        let is_rotation = skew.to_cols_array().iter().all(|x| x.abs() <= LEAST_SKEW);
        let is_near = origin.length() <= FARTHEST && radius <= LARGEST_RADIUS;
        (is_rotation && is_near).then(|| Self {
            turn: turn.transpose().to_cols_array_2d().map(|row| fixed_direction(row.into())),
            origin: (origin * (1u64 << 50) as f64).to_array().map(|x| x.round() as i64),
            reach: ((radius * radius - origin.length_squared()) * (1u64 << 40) as f64).round()
                as i64,
        })
    }

    /// The ray of the beam in this direction, as [`fixed_direction`] gives it.
    #[must_use]
    pub fn aim(&self, beam: [i32; 3]) -> FixedRay {
        let direction = self.turn.map(|row| rounded(dot(row, beam), 30) as i32);
        let sensor = self.origin.map(|x| (x >> 27) as i32);
        let along = -((dot(sensor, direction) >> 33) as i32);
        let within = ((self.reach + i64::from(along) * i64::from(along)) >> 24) as i32;
        let skipped = (along - 6 * within.max(0) - BEFORE).max(0);
        let origin = [0, 1, 2].map(|axis| {
            let forward = i64::from(direction[axis]) * i64::from(skipped);
            rounded(self.origin[axis] + forward, 27) as i32
        });
        FixedRay { origin, direction: direction.map(|x| (x + 32) >> 6), skipped }
    }
}

/// A unit vector in units of 2^-30.
#[must_use]
pub fn fixed_direction(direction: DVec3) -> [i32; 3] {
    (direction * f64::from(1 << 30)).to_array().map(|x| x.round() as i32)
}

fn dot(a: [i32; 3], b: [i32; 3]) -> i64 {
    (0..3).map(|i| i64::from(a[i]) * i64::from(b[i])).sum()
}

/// `x / 2^shift` to the nearest whole number.
fn rounded(x: i64, shift: u32) -> i64 {
    (x + (1 << (shift - 1))) >> shift
}

#[cfg(test)]
pub mod tests;
