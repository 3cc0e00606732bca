//! Makes rays from a sensor's beams in integer arithmetic, which is exact, so that every adapter
//! makes the same rays. Twin of `shaders/aim.wgsl`.
//!
//! [`DISPLACEMENT`](super::intersect::DISPLACEMENT) limits the distance of a computed ray from
//! the true one at the object, but an error of the direction grows with the distance to the
//! sensor. A direction rounded to f32 would be off by 64 units of u = 2^-24 over 128 unit
//! lengths. Here a component of the direction is off by (2 sqrt(3) + 1) * 2^-31: beam and
//! rotation are each rounded to a multiple of 2^-30, which adds sqrt(3) * 2^-31 each, and the
//! rotated beam is rounded likewise. Over the farthest distance that makes 4.5u. The start is
//! rounded to a multiple of 2^-23, which adds 1u. From the start on the direction is rounded to a
//! multiple of 2^-24: 0.6u over each unit length.
//!
//! A ray may start anywhere before the bounding sphere, so that no square root is needed. If the
//! sphere's chord is 2 sqrt(w) long, the ray starts h = 3/8 w + 11/16 before the chord's middle.
//! This is at least sqrt(w) + 1/48 (the tangent at 16/9 lies at 2/3), which leaves room for
//! rounding: `w` is off by less than 0.001. As the middle's squared distance from the centre is
//! r^2 - w, no start is farther than 1.87 from the centre, and the sphere's far side is at most
//! 3.55 away.

use crate::fixed_frame::FixedFrame;

/// 11/16 in units of 2^-20: the constant part of h, see the module.
pub const BEFORE: i32 = 11 << 16;

/// A ray in integers.
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
    /// The ray of the beam in this direction, in the units of
    /// [`fixed_direction`](crate::fixed_frame::fixed_direction).
    #[must_use]
    pub fn aim(&self, beam: [i32; 3]) -> FixedRay {
        let direction = self.turn.map(|row| rounded(dot(row, beam), 30) as i32);
        // Units of 2^-23; with a direction in 2^-30, the product is in 2^-53 and `along` in 2^-20.
        let sensor = self.origin.map(|x| (x >> 27) as i32);
        let along = -((dot(sensor, direction) >> 33) as i32);
        // w in units of 2^-16: 6 of it are 3/8 w in units of 2^-20.
        let within = ((self.reach + i64::from(along) * i64::from(along)) >> 24) as i32;
        let skipped = (along - 6 * within.max(0) - BEFORE).max(0);
        let origin = [0, 1, 2].map(|axis| {
            // Both are in units of 2^-50.
            let forward = i64::from(direction[axis]) * i64::from(skipped);
            rounded(self.origin[axis] + forward, 27) as i32
        });
        FixedRay { origin, direction: direction.map(|x| (x + 32) >> 6), skipped }
    }
}

fn dot(a: [i32; 3], b: [i32; 3]) -> i64 {
    (0..3).map(|i| i64::from(a[i]) * i64::from(b[i])).sum()
}

/// `x / 2^shift` rounded to the nearest integer.
fn rounded(x: i64, shift: u32) -> i64 {
    (x + (1 << (shift - 1))) >> shift
}

/// Direction cases, which the tests of the GPU cast as well.
#[cfg(test)]
pub mod tests;
