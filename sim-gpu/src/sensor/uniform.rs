//! A regular grid in azimuth and elevation, such as BLAINDER's rotating scanner.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{MAX_RINGS, Rays, checked_ray_count};
use crate::config::{InvalidValue, positive, within};

/// A regular grid of angles that includes both ends of each axis; the azimuth is the outer loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uniform {
    /// First azimuth, counterclockwise from forward.
    pub azimuth_from_deg: f64,
    /// Last azimuth.
    pub azimuth_to_deg: f64,
    /// Number of azimuths.
    pub azimuth_steps: u32,
    /// First elevation, above the x-y plane.
    pub elevation_from_deg: f64,
    /// Last elevation.
    pub elevation_to_deg: f64,
    /// Number of elevations.
    pub elevation_steps: u32,
    /// Revolutions per minute, for the time of each column; if absent, all rays are cast at time 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rpm: Option<f64>,
}

impl Uniform {
    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        within("uniform.azimuth_from_deg", self.azimuth_from_deg, -360.0..=360.0)?;
        within("uniform.azimuth_to_deg", self.azimuth_to_deg, -360.0..=360.0)?;
        within("uniform.elevation_from_deg", self.elevation_from_deg, -90.0..=90.0)?;
        within("uniform.elevation_to_deg", self.elevation_to_deg, -90.0..=90.0)?;
        within("uniform.elevation_steps", f64::from(self.elevation_steps), 0.0..=MAX_RINGS)?;
        positive("uniform.rpm", self.rpm)?;
        let n_rays = u64::from(self.azimuth_steps) * u64::from(self.elevation_steps);
        checked_ray_count("uniform.azimuth_steps x uniform.elevation_steps", n_rays)
    }

    pub(super) fn rays(&self, keep_each: u32) -> Rays {
        let azimuths_deg =
            linear_steps(self.azimuth_from_deg, self.azimuth_to_deg, self.azimuth_steps);
        let elevations_deg =
            linear_steps(self.elevation_from_deg, self.elevation_to_deg, self.elevation_steps);
        let rows: Vec<(f64, f64)> =
            elevations_deg.map(|deg| libm::sincos(deg.to_radians())).collect();
        let downwards = self.elevation_from_deg > self.elevation_to_deg;
        let n_columns = self.azimuth_steps.div_ceil(keep_each) as usize;
        let mut rays = Rays::with_capacity(n_columns * rows.len());
        for azimuth_deg in azimuths_deg.step_by(keep_each as usize) {
            let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_deg.to_radians());
            let time_s = self.time_s(azimuth_deg);
            for (row, &(sin_elevation, cos_elevation)) in rows.iter().enumerate() {
                let direction = DVec3::new(
                    cos_elevation * cos_azimuth,
                    cos_elevation * sin_azimuth,
                    sin_elevation,
                );
                let ring = if downwards { rows.len() - 1 - row } else { row };
                rays.push(direction, ring as u16, time_s);
            }
        }
        rays
    }

    fn time_s(&self, azimuth_deg: f64) -> f64 {
        let turned = (azimuth_deg - self.azimuth_from_deg).abs() / 360.0;
        self.rpm.map_or(0.0, |rpm| turned * 60.0 / rpm)
    }
}

/// `steps` numbers evenly spaced from `from` to `to`, both included; only `from` for one step.
pub(super) fn linear_steps(from: f64, to: f64, steps: u32) -> impl Iterator<Item = f64> {
    let last = steps.saturating_sub(1);
    let step = (to - from) / f64::from(last.max(1));
    (0..steps).map(move |i| if i == last && i > 0 { to } else { from + f64::from(i) * step })
}
