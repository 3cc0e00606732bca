//! Positions and orientations of sensors and instances.
//!
//! Sensor frame: x forward, y left, z up, right-handed (ROS REP 103). World
//! frame: z up, right-handed, metres.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::config::{self, ConfigError, InvalidValue};

pub(crate) use orientation::PoseKeys;
pub use trajectory::Trajectory;

mod orientation;
mod trajectory;

/// The position and the orientation of a sensor, or of an instance of a mesh, in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The origin of its frame in the world, metres.
    pub position_m: DVec3,
    /// Turns vectors of its frame into the world frame; of unit length, written `[x, y, z, w]`.
    #[serde(rename = "quaternion_xyzw")]
    pub rotation: DQuat,
}

impl Pose {
    /// At the origin, not turned: a sensor looks along x.
    pub const IDENTITY: Self = Self { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// From its frame to the world's: a matrix of 4 by 4, row by row.
    #[must_use]
    pub fn matrix(&self) -> [f64; 16] {
        let matrix = DMat4::from_rotation_translation(self.rotation, self.position_m);
        matrix.transpose().to_cols_array()
    }

    /// `map` as a pose after factors along the axes, all above 0; `None` if it mirrors or shears, or
    /// flattens an axis.
    pub(crate) fn of_scaled(map: &DAffine3) -> Option<(Self, DVec3)> {
        /// Several products of transforms in f32, of which files are made.
        const ROUNDING: f64 = 1e-6;
        let axes = map.matrix3;
        let scale = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
        let rotation = axes * DMat3::from_diagonal(scale.recip());
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        let is_rotation = off.to_cols_array().into_iter().all(|off| off.abs() <= ROUNDING);
        let rotation = (is_rotation && rotation.determinant() > 0.0)
            .then(|| DQuat::from_mat3(&rotation).normalize())?;
        Some((Self { position_m: map.translation, rotation }, scale))
    }

    /// The pose at this share of the way to `other`: along a line, and along the shortest arc.
    pub(crate) fn towards(&self, other: &Self, share: f64) -> Self {
        Self {
            position_m: self.position_m.lerp(other.position_m, share),
            rotation: self.rotation.slerp(other.rotation, share).normalize(),
        }
    }

    /// At this position, metres, not turned.
    #[must_use]
    pub fn at(position_m: impl Into<DVec3>) -> Self {
        Self { position_m: position_m.into(), ..Self::IDENTITY }
    }

    /// At this position, metres, turned by this quaternion x, y, z, w, which becomes one of length 1.
    ///
    /// # Errors
    /// A coordinate is not finite; the square of the quaternion's length is not 1 to within 0.001, as that
    /// of rotations in f32 is.
    pub fn rigid(position_m: [f64; 3], quaternion_xyzw: [f64; 4]) -> Result<Self, InvalidValue> {
        if let Some(number) = position_m.into_iter().find(|number| !number.is_finite()) {
            let cause = format!("expected a position of finite metres, found {number}");
            return Err(InvalidValue::new("position_m", cause));
        }
        let rotation = DQuat::from_array(quaternion_xyzw);
        let length = rotation.length();
        let off = (length * length - 1.0).abs();
        if off.is_nan() || off >= 1e-3 {
            let cause = format!(
                "expected a quaternion of length 1, found {quaternion_xyzw:?} (x, y, z, w) of length {length:.4}"
            );
            return Err(InvalidValue::new("quaternion_xyzw", cause));
        }
        Ok(Self { position_m: position_m.into(), rotation: rotation.normalize() })
    }

    /// At the same position, turned by `yaw_deg` about z, then by `pitch_deg` about its own y axis
    /// (a positive angle looks down), then by `roll_deg` about its own x axis.
    #[must_use]
    pub fn turned_deg(self, yaw_deg: f64, pitch_deg: f64, roll_deg: f64) -> Self {
        let turn = DQuat::from_rotation_z(yaw_deg.to_radians())
            * DQuat::from_rotation_y(pitch_deg.to_radians())
            * DQuat::from_rotation_x(roll_deg.to_radians());
        Self { rotation: self.rotation * turn, ..self }
    }

    /// `distance_m` from the origin, looking at it; the azimuth is counterclockwise from x.
    #[must_use]
    pub fn looking_at_origin_deg(distance_m: f64, elevation_deg: f64, azimuth_deg: f64) -> Self {
        let (elevation_rad, azimuth_rad) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
        Self::view(distance_m, elevation_rad, azimuth_rad, DVec3::ZERO)
    }

    /// The sensor at `position_m` that looks at `target_m`, upright, with a level left axis.
    /// Straight above or below the target, its orientation is the limit along azimuth 0.
    ///
    /// # Errors
    /// If a coordinate is not finite, or the two points are equal or so far
    /// apart that their distance overflows.
    pub fn look_at(position_m: DVec3, target_m: DVec3) -> Result<Self, InvalidValue> {
        if !position_m.is_finite() {
            return Err(InvalidValue::new("position_m", "expected finite numbers"));
        }
        let to_target = target_m - position_m;
        if to_target == DVec3::ZERO {
            return Err(InvalidValue::new("look_at_m", "expected another point than the position"));
        }
        // Scaled first, so that squares neither overflow nor vanish.
        let to_target = to_target / to_target.abs().max_element();
        if !to_target.is_finite() {
            return Err(InvalidValue::new(
                "look_at_m",
                "expected finite numbers and a distance that f64 holds",
            ));
        }
        let level = libm::hypot(to_target.x, to_target.y);
        let azimuth_rad = if level == 0.0 { 0.0 } else { libm::atan2(-to_target.y, -to_target.x) };
        let elevation_rad = libm::atan2(-to_target.z, level);
        Ok(Self { position_m, rotation: facing_inwards(elevation_rad, azimuth_rad) })
    }

    /// The sensor that stands `distance_m` from `target_m` at this elevation
    /// and azimuth (radians, counterclockwise from world x) and looks at it.
    /// The azimuth determines the orientation even at elevation +-90 degrees.
    #[must_use]
    pub fn view(distance_m: f64, elevation_rad: f64, azimuth_rad: f64, target_m: DVec3) -> Self {
        Self {
            position_m: target_m + distance_m * outwards(elevation_rad, azimuth_rad),
            rotation: facing_inwards(elevation_rad, azimuth_rad),
        }
    }
}

/// The azimuth of number `view` of `count` views that are spread evenly from the first on, radians.
pub(crate) fn azimuth_on_ring(view: u32, count: u32, first_azimuth_rad: f64) -> f64 {
    first_azimuth_rad + TAU * f64::from(view) / f64::from(count)
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
pub fn load_poses(file: &Path) -> Result<Vec<Pose>, ConfigError> {
    config::read(file, poses)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PosesFile {
    #[serde(default)]
    pose: Vec<PoseKeys>,
}

fn poses(PosesFile { pose }: PosesFile) -> Result<Vec<Pose>, Vec<InvalidValue>> {
    if pose.is_empty() {
        return Err(InvalidValue::new("pose", "expected at least one [[pose]], found none").into());
    }
    config::all(pose.iter().enumerate().map(|(i, keys)| keys.pose(&format!("pose[{i}]"))))
}

/// The rotation of a sensor at this elevation and azimuth from its target that looks at the target
/// with a level left axis.
fn facing_inwards(elevation_rad: f64, azimuth_rad: f64) -> DQuat {
    let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
    let forward = -outwards(elevation_rad, azimuth_rad);
    let left = DVec3::new(sin_azimuth, -cos_azimuth, 0.0);
    DQuat::from_mat3(&DMat3::from_cols(forward, left, forward.cross(left))).normalize()
}

fn outwards(elevation_rad: f64, azimuth_rad: f64) -> DVec3 {
    let (sin_elevation, cos_elevation) = libm::sincos(elevation_rad);
    let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
    DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
}

#[cfg(test)]
mod tests;
