//! The pixels of a camera: uniform in the tangent of the angle.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::uniform::linear_steps;
use super::{MAX_RINGS, Rays, checked_ray_count};
use crate::config::{InvalidValue, finite, positive, within};

/// An image, row by row from the top left, with a single exposure time. It states either its
/// fields of view or its focal lengths and principal point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The angle, above 0 and below 180, from the centres of the leftmost pixels to those of the rightmost: BLAINDER's
    /// static scanner puts pixel centres on the edges of the view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov_x_deg: Option<f64>,
    /// The angle, above 0 and below 180, from the centres of the top pixels to those of the bottom
    /// pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov_y_deg: Option<f64>,
    /// Horizontal focal length in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fx: Option<f64>,
    /// Vertical focal length in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fy: Option<f64>,
    /// Column of the principal point; the centre of the first column is 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cx: Option<f64>,
    /// Row of the principal point; the centre of the first row is 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cy: Option<f64>,
}

enum Optics {
    FieldOfView { x_deg: f64, y_deg: f64 },
    Pinhole { fx: f64, fy: f64, cx: f64, cy: f64 },
}

impl Grid {
    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        match self.optics()? {
            Optics::FieldOfView { x_deg, y_deg } => {
                for (key, fov_deg) in [("grid.fov_x_deg", x_deg), ("grid.fov_y_deg", y_deg)] {
                    positive(key, fov_deg)?;
                    if fov_deg >= 180.0 {
                        let cause = format!("expected a number below 180, found {fov_deg}");
                        return Err(InvalidValue::new(key, cause));
                    }
                }
            }
            Optics::Pinhole { fx, fy, cx, cy } => {
                positive("grid.fx", fx)?;
                positive("grid.fy", fy)?;
                finite("grid.cx", cx)?;
                finite("grid.cy", cy)?;
            }
        }
        within("grid.height", f64::from(self.height), 0.0..=MAX_RINGS)?;
        let n_rays = u64::from(self.width) * u64::from(self.height);
        checked_ray_count("grid.width x grid.height", n_rays)
    }

    fn optics(&self) -> Result<Optics, InvalidValue> {
        match (self.fov_x_deg, self.fov_y_deg, self.fx, self.fy, self.cx, self.cy) {
            (Some(x_deg), Some(y_deg), None, None, None, None) => {
                Ok(Optics::FieldOfView { x_deg, y_deg })
            }
            (None, None, Some(fx), Some(fy), Some(cx), Some(cy)) => {
                Ok(Optics::Pinhole { fx, fy, cx, cy })
            }
            _ => {
                let cause = "expected either fov_x_deg and fov_y_deg, or fx, fy, cx and cy";
                Err(InvalidValue::new("grid", cause))
            }
        }
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
        let optics = self.optics().expect("invariant: validated");
        match optics {
            Optics::FieldOfView { x_deg, y_deg } => {
                let edge = |fov_deg: f64| libm::tan(fov_deg.to_radians() / 2.0);
                let across = |edge: f64, n: u32| linear_steps(edge, -edge, n).collect();
                (across(edge(x_deg), self.width), across(edge(y_deg), self.height))
            }
            Optics::Pinhole { fx, fy, cx, cy } => {
                let across = |n: u32, centre: f64, focal: f64| {
                    (0..n).map(|i| (centre - f64::from(i)) / focal).collect()
                };
                (across(self.width, cx, fx), across(self.height, cy, fy))
            }
        }
    }
}

/// The direction of a pixel, scaled before it is normalized, so that a tiny focal length does not
/// overflow.
fn unit(left: f64, up: f64) -> DVec3 {
    let largest = left.abs().max(up.abs()).max(1.0);
    (DVec3::new(1.0, left, up) / largest).normalize()
}
