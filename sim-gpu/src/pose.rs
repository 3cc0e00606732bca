//! Where a sensor stands and how it is turned.
//!
//! Sensor frame: x forward, y left, z up, right-handed (ROS REP 103). World
//! frame: z up, right-handed, metres.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::config::{self, ConfigError, InvalidValue};

pub use orientation::OrientationKeys;
pub(crate) use orientation::vector;

mod orientation;

/// A rigid placement of a sensor in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of the sensor in the world, metres.
    pub position_m: DVec3,
    /// Turns vectors of the sensor frame into the world frame; of unit length,
    /// written `[x, y, z, w]`.
    #[serde(rename = "quaternion_xyzw")]
    pub world_from_sensor: DQuat,
}

impl Pose {
    /// The sensor at `position_m` that looks at `target_m`, upright: its left
    /// axis is level. Straight above or below the target, where upright means
    /// nothing, it is turned as a sensor that came there along azimuth 0.
    ///
    /// # Errors
    ///
    /// If a coordinate is not finite, or the two points are equal or so far
    /// apart that their distance overflows.
    pub fn look_at(position_m: DVec3, target_m: DVec3) -> Result<Self, InvalidValue> {
        if !position_m.is_finite() {
            return Err(InvalidValue::new("position_m", "is not finite"));
        }
        let to_target = target_m - position_m;
        if to_target == DVec3::ZERO {
            return Err(InvalidValue::new("look_at_m", "is the position itself"));
        }
        // Scaled first, so that neither a square overflows nor one vanishes.
        let to_target = to_target / to_target.abs().max_element();
        if !to_target.is_finite() {
            return Err(InvalidValue::new("look_at_m", "is not finite, or too far away"));
        }
        let level = to_target.x.hypot(to_target.y);
        let azimuth_rad = if level == 0.0 { 0.0 } else { (-to_target.y).atan2(-to_target.x) };
        let elevation_rad = (-to_target.z).atan2(level);
        Ok(Self { position_m, world_from_sensor: facing_inwards(elevation_rad, azimuth_rad) })
    }

    /// The sensor that stands `distance_m` from `target_m` at this elevation
    /// and azimuth (radians, counterclockwise from world x) and looks at it.
    /// The azimuth decides how it is turned even at elevation +-90 degrees.
    #[must_use]
    pub fn view(distance_m: f64, elevation_rad: f64, azimuth_rad: f64, target_m: DVec3) -> Self {
        let (sin_elevation, cos_elevation) = elevation_rad.sin_cos();
        let (sin_azimuth, cos_azimuth) = azimuth_rad.sin_cos();
        let outwards =
            DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation);
        Self {
            position_m: target_m + distance_m * outwards,
            world_from_sensor: facing_inwards(elevation_rad, azimuth_rad),
        }
    }

    /// The map from the sensor frame to the world frame.
    #[must_use]
    pub fn world_from_sensor_affine(&self) -> DAffine3 {
        DAffine3::from_rotation_translation(self.world_from_sensor, self.position_m)
    }
}

/// `count` views of `target_m` at equal distance and elevation, spread evenly
/// over the full circle from the first azimuth on, counterclockwise. None for
/// a count of 0.
#[must_use]
pub fn ring_of_views(
    count: u32,
    distance_m: f64,
    elevation_rad: f64,
    first_azimuth_rad: f64,
    target_m: DVec3,
) -> Vec<Pose> {
    let azimuth_rad = |i: u32| first_azimuth_rad + TAU * f64::from(i) / f64::from(count);
    (0..count).map(|i| Pose::view(distance_m, elevation_rad, azimuth_rad(i), target_m)).collect()
}

/// Reads a file of poses:
///
/// ```toml
/// [[pose]]
/// position_m = [3, 0, 1]
/// look_at_m = [0, 0, 0]
///
/// [[pose]]
/// position_m = [0, 3, 1]
/// yaw_deg = -90   # about z, then
/// pitch_deg = 20  # about y (positive looks down), then
/// roll_deg = 0    # about x
///
/// [[pose]]
/// position_m = [0, 0, 3]
/// quaternion_xyzw = [0, 0.7071, 0, 0.7071]
/// ```
///
/// An empty file is an empty list.
///
/// # Errors
///
/// Names the file, the pose and the cause.
pub fn load_poses(file: &Path) -> Result<Vec<Pose>, ConfigError> {
    let poses: PosesFile = config::read(file)?;
    poses.validate().map_err(|invalid| invalid.in_file(file))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PosesFile {
    #[serde(default)]
    pose: Vec<PoseTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseTable {
    position_m: [f64; 3],
    look_at_m: Option<[f64; 3]>,
    yaw_deg: Option<f64>,
    pitch_deg: Option<f64>,
    roll_deg: Option<f64>,
    quaternion_xyzw: Option<[f64; 4]>,
}

impl PosesFile {
    fn validate(self) -> Result<Vec<Pose>, InvalidValue> {
        let tables = self.pose.into_iter().enumerate();
        tables
            .map(|(i, table)| {
                let keys = OrientationKeys {
                    look_at_m: table.look_at_m,
                    yaw_deg: table.yaw_deg,
                    pitch_deg: table.pitch_deg,
                    roll_deg: table.roll_deg,
                    quaternion_xyzw: table.quaternion_xyzw,
                };
                keys.pose(&format!("pose[{i}]"), table.position_m)
            })
            .collect()
    }
}

/// The rotation of a sensor that stands at this elevation and azimuth as seen
/// from its target, and looks at the target with a level left axis.
fn facing_inwards(elevation_rad: f64, azimuth_rad: f64) -> DQuat {
    let (sin_elevation, cos_elevation) = elevation_rad.sin_cos();
    let (sin_azimuth, cos_azimuth) = azimuth_rad.sin_cos();
    let forward =
        DVec3::new(-cos_elevation * cos_azimuth, -cos_elevation * sin_azimuth, -sin_elevation);
    let left = DVec3::new(sin_azimuth, -cos_azimuth, 0.0);
    DQuat::from_mat3(&DMat3::from_cols(forward, left, forward.cross(left))).normalize()
}

#[cfg(test)]
mod tests;
