//! Cones of directions that bound an object or a block of rays.

use std::f64::consts::PI;

use glam::DVec3;

/// The margin of half angles, so that rounding loses no ray.
const ANGLE_MARGIN_RAD: f64 = 1e-9;
/// The margin of cosines. A dot product of two vectors whose lengths are within 1e-15 of 1 is off
/// by less than 2e-15 + 3 ulp, which is below 3e-15.
const COSINE_MARGIN: f64 = 4e-15;

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector in the sensor frame.
    pub axis: DVec3,
    /// Largest angle from the axis, radians.
    pub half_angle_rad: f64,
}

/// A cone with its margins, ready for tests.
pub(super) struct WidenedCone {
    axis: DVec3,
    cos: f64,
    sin: f64,
    /// Lowest dot product of a ray inside.
    threshold: f64,
}

/// The bounding cone of some rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockCone {
    axis: DVec3,
    cos: f64,
    sin: f64,
}

impl Cone {
    /// This cone with its margins; `None` if it holds every direction.
    pub(super) fn widened(&self) -> Option<WidenedCone> {
        let half_angle_rad = self.half_angle_rad + ANGLE_MARGIN_RAD;
        let is_part = half_angle_rad < PI && self.axis.is_finite();
        is_part.then(|| {
            let (sin, cos) = libm::sincos(half_angle_rad.max(0.0));
            WidenedCone { axis: self.axis, cos, sin, threshold: cos - COSINE_MARGIN }
        })
    }
}

impl WidenedCone {
    pub(super) fn holds(&self, direction: DVec3) -> bool {
        self.axis.dot(direction) >= self.threshold
    }

    /// Whether no ray of the block can lie inside: the axes are farther apart
    /// than the two half angles together.
    pub(super) fn misses(&self, block: &BlockCone) -> bool {
        // cos(a) <= -cos(b) = cos(pi - b): together the half angles reach around the sphere.
        let reach_around = block.cos <= -self.cos;
        let cos_of_sum = block.cos * self.cos - block.sin * self.sin;
        !reach_around && self.axis.dot(block.axis) < cos_of_sum - COSINE_MARGIN
    }
}

impl BlockCone {
    /// The cone around the mean direction that holds all `directions`.
    pub(super) fn around(directions: impl Iterator<Item = DVec3> + Clone) -> Self {
        let axis = directions.clone().sum::<DVec3>().try_normalize().unwrap_or(DVec3::X);
        let lowest = directions.map(|direction| axis.dot(direction)).fold(1.0, f64::min);
        let cos = (lowest - COSINE_MARGIN).max(-1.0);
        // By factors: 1 - cos^2 would lose all digits of a thin cone.
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        Self { axis, cos, sin }
    }
}
