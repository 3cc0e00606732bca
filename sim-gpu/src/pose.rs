//! Files of poses.

use std::f64::consts::TAU;
use std::path::Path;

use serde::Deserialize;

use crate::config::{self, ConfigError, InvalidValue};

pub use formats::geometry::{Pose, Trajectory};
pub(crate) use orientation::PoseKeys;

mod orientation;

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
    config::read(file, "poses", poses)
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

#[cfg(test)]
mod tests;
