//! The frame of a sensor and an object in integers, from which casters make rays. `cpu::aim`
//! derives the bounds of its rounding.

use glam::{DMat3, DVec3};

/// How far a sensor may be from an object's centre, unit lengths.
const FARTHEST: f64 = 128.0;

/// The largest radius of a bounding sphere that these bounds allow for: around a cube of side 2,
/// with the margin for rounding.
const LARGEST_RADIUS: f64 = 1.7321;

/// How far a map of directions may be from a rotation: the most that rounding to 2^-30 adds.
const LEAST_SKEW: f64 = 1.0 / (1 << 30) as f64;

/// The frame of one sensor and one object, in integers.
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

impl FixedFrame {
    /// The frame of a sensor at `origin`; `None` if integers are not exact enough: for an object
    /// that is unevenly scaled, or very far away.
    #[must_use]
    pub fn new(origin: DVec3, unit_from_sensor: &DMat3, radius: f64) -> Option<Self> {
        let columns = unit_from_sensor.to_cols_array_2d().map(DVec3::from_array);
        let squared = columns.map(DVec3::length_squared).iter().sum::<f64>() / 3.0;
        let turn = *unit_from_sensor * squared.sqrt().recip();
        let skew = turn.transpose() * turn - DMat3::IDENTITY;
        // A comparison with NaN is false.
        let is_rotation = skew.to_cols_array().iter().all(|x| x.abs() <= LEAST_SKEW);
        let is_near = origin.length() <= FARTHEST && radius <= LARGEST_RADIUS;
        (is_rotation && is_near).then(|| Self {
            turn: turn.transpose().to_cols_array_2d().map(|row| fixed_direction(row.into())),
            origin: (origin * (1u64 << 50) as f64).to_array().map(|x| x.round() as i64),
            reach: ((radius * radius - origin.length_squared()) * (1u64 << 40) as f64).round()
                as i64,
        })
    }
}

/// A unit vector in units of 2^-30.
#[must_use]
pub fn fixed_direction(direction: DVec3) -> [i32; 3] {
    (direction * f64::from(1 << 30)).to_array().map(|x| x.round() as i32)
}
