//! The azimuths that the beams of a packet cover.

use glam::{DVec2, DVec3};
use sim_gpu::sensors::BeamPattern;

/// An interval of azimuths in the sensor's frame.
pub(crate) struct Sector {
    middle: DVec2,
    half_rad: f64,
}

impl Sector {
    pub(crate) fn of_beams(pattern: &BeamPattern) -> Self {
        let level = pattern.directions.iter().map(|direction| direction.truncate().normalize());
        let middle = level.clone().sum::<DVec2>().normalize();
        let half_rad = level.map(|beam| middle.angle_to(beam).abs()).fold(0.0, f64::max);
        Self { middle, half_rad }
    }

    /// Whether a beam can hit the sphere around `centre_m`.
    pub(crate) fn meets(&self, centre_m: DVec3, radius_m: f64) -> bool {
        let centre_m = centre_m.truncate();
        let share = radius_m / centre_m.length();
        // The margin of a nanoradian is far above the rounding of f64.
        let widest_rad = self.half_rad + libm::asin(share.min(1.0)) + 1e-9;
        share >= 1.0 || self.middle.angle_to(centre_m).abs() <= widest_rad
    }
}
