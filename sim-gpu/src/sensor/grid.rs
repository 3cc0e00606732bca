//! The pixels of a camera: uniform in the tangent of the angle.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::uniform::linear_steps;
use super::{MAX_RINGS, Rays, checked_ray_count};
use crate::config::{InvalidValue, positive, within};

/// An image, row by row from the top left, with a single exposure time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The angle, above 0 and below 180, from the centres of the leftmost pixels to those of the
    /// rightmost: BLAINDER's static scanner puts pixel centres on the edges of the view.
    pub fov_x_deg: f64,
    /// The angle, above 0 and below 180, from the centres of the top pixels to those of the bottom
    /// pixels.
    pub fov_y_deg: f64,
}

impl Grid {
    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        for (key, fov_deg) in
            [("grid.fov_x_deg", self.fov_x_deg), ("grid.fov_y_deg", self.fov_y_deg)]
        {
            positive(key, fov_deg)?;
            if fov_deg >= 180.0 {
                let cause = format!("expected a number below 180, found {fov_deg}");
                return Err(InvalidValue::new(key, cause));
            }
        }
        within("grid.height", f64::from(self.height), 0.0..=MAX_RINGS)?;
        let n_rays = u64::from(self.width) * u64::from(self.height);
        checked_ray_count("grid.width x grid.height", n_rays)
    }

    pub(super) fn rays(&self, keep_each: u32) -> Rays {
        let (leftwards, upwards) = self.tangents();
        let n_columns = self.width.div_ceil(keep_each) as usize;
        let mut rays = Rays::with_capacity(n_columns * upwards.len());
        for (ring, &up) in (0..self.height as u16).rev().zip(&upwards) {
            for &left in leftwards.iter().step_by(keep_each as usize) {
                rays.push(unit(left, up), ring, 0.0);
            }
        }
        rays
    }

    /// The tangents to the left of each column, and upwards of each row.
    pub(super) fn tangents(&self) -> (Vec<f64>, Vec<f64>) {
        let across = |fov_deg: f64, n: u32| {
            let edge = libm::tan(fov_deg.to_radians() / 2.0);
            linear_steps(edge, -edge, n).collect()
        };
        (across(self.fov_x_deg, self.width), across(self.fov_y_deg, self.height))
    }
}

/// The direction of a pixel, scaled before it is normalized, so that a view of nearly 180 degrees does
/// not overflow.
fn unit(left: f64, up: f64) -> DVec3 {
    let largest = left.abs().max(up.abs()).max(1.0);
    (DVec3::new(1.0, left, up) / largest).normalize()
}
