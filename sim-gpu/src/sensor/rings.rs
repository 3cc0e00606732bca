//! Snapping points to rings of constant polar angle, as ModelNet40-C does.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};

/// Rings of points: each step of `step_deg` in polar angle keeps some of its points and moves them
/// to its middle. Source: jiachens/ModelNet40-C, `data/generate_c.py`, `simulate_lidar`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rings {
    /// The angle between rings.
    pub step_deg: f64,
    /// The start of the part of a step that is kept, in 0..1.
    pub keep_from: f64,
    /// The end of that part, exclusive, in 0..=1.
    pub keep_to: f64,
}

impl Rings {
    /// The direction snapped to its ring, `None` if it lies between two rings.
    ///
    /// `direction` is a unit vector from the sensor in world axes. `first_polar_rad` is the polar
    /// angle at which the first ring begins: the recipe takes the smallest [`polar_angle_rad`] of
    /// the scan. The azimuth does not change.
    #[must_use]
    pub fn snap_to_ring(&self, direction: DVec3, first_polar_rad: f64) -> Option<DVec3> {
        let step_rad = self.step_deg.to_radians();
        let steps = (polar_angle_rad(direction) - first_polar_rad) / step_rad;
        let ring = steps.floor();
        if !(self.keep_from..self.keep_to).contains(&(steps - ring)) {
            return None;
        }
        let polar_rad = first_polar_rad + (ring + 0.5) * step_rad;
        let (sin_polar, cos_polar) = libm::sincos(polar_rad);
        let (sin_azimuth, cos_azimuth) = libm::sincos(libm::atan2(direction.y, direction.x));
        Some(DVec3::new(sin_polar * cos_azimuth, sin_polar * sin_azimuth, cos_polar))
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        positive("rings.step_deg", self.step_deg)?;
        within("rings.keep_from", self.keep_from, 0.0..=1.0)?;
        within("rings.keep_to", self.keep_to, 0.0..=1.0)?;
        if self.keep_from >= self.keep_to {
            let cause = format!("expected a number above rings.keep_from, found {}", self.keep_to);
            return Err(InvalidValue::new("rings.keep_to", cause));
        }
        Ok(())
    }
}

/// The angle between a vector and the z axis, radians in 0..=pi.
#[must_use]
pub fn polar_angle_rad(vector: DVec3) -> f64 {
    libm::atan2(libm::hypot(vector.x, vector.y), vector.z)
}
