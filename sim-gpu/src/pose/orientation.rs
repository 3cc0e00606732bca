//! The three ways to write an orientation in TOML.

use glam::{DQuat, DVec3};

use serde::Deserialize;

use super::Pose;
use crate::config::{InvalidValue, finite};

/// The keys of a pose, as read, with at most one of the orientations.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PoseKeys {
    /// The position, metres.
    pub position_m: [f64; 3],
    /// The point that the x axis points at, metres, instead of the angles.
    pub look_at_m: Option<[f64; 3]>,
    /// Angle about z, counterclockwise seen from above, applied last.
    pub yaw_deg: Option<f64>,
    /// Angle about y; positive turns the x axis down.
    pub pitch_deg: Option<f64>,
    /// Angle about x, applied first.
    pub roll_deg: Option<f64>,
    /// A quaternion of length 1, instead of the angles.
    pub quaternion_xyzw: Option<[f64; 4]>,
}

impl PoseKeys {
    /// The pose of a sensor, whose orientation is required. Errors name the TOML `table`.
    pub fn pose(&self, table: &str) -> Result<Pose, InvalidValue> {
        let position_m = self.position_m(table)?;
        if let Some(target_m) = self.look_at_m {
            self.only_one_way(table)?;
            let target_m = all_finite(&format!("{table}.look_at_m"), target_m)?.into();
            return Pose::look_at(position_m, target_m)
                .map_err(|e| InvalidValue::new(format!("{table}.{}", e.key), e.cause));
        }
        let rotation = self.rotation(table)?.ok_or_else(|| {
            let cause = "expected look_at_m, yaw_deg/pitch_deg/roll_deg or quaternion_xyzw, found \
                         none of them";
            InvalidValue::new(table, cause)
        })?;
        Ok(Pose { position_m, rotation })
    }

    /// The position, if it is finite.
    pub fn position_m(&self, table: &str) -> Result<DVec3, InvalidValue> {
        all_finite(&format!("{table}.position_m"), self.position_m).map(DVec3::from_array)
    }

    /// The rotation by angles or by quaternion, `None` if neither is stated.
    pub fn rotation(&self, table: &str) -> Result<Option<DQuat>, InvalidValue> {
        self.only_one_way(table)?;
        if let Some(xyzw) = self.quaternion_xyzw {
            return quaternion(&format!("{table}.quaternion_xyzw"), xyzw).map(Some);
        }
        if !self.has_angles() {
            return Ok(None);
        }
        let radians = |key: &str, degrees: Option<f64>| {
            finite(&format!("{table}.{key}"), degrees)?;
            Ok(degrees.unwrap_or(0.0).to_radians())
        };
        let yaw = DQuat::from_rotation_z(radians("yaw_deg", self.yaw_deg)?);
        let pitch = DQuat::from_rotation_y(radians("pitch_deg", self.pitch_deg)?);
        let roll = DQuat::from_rotation_x(radians("roll_deg", self.roll_deg)?);
        Ok(Some((yaw * pitch * roll).normalize()))
    }

    fn has_angles(&self) -> bool {
        [self.yaw_deg, self.pitch_deg, self.roll_deg].iter().any(Option::is_some)
    }

    fn only_one_way(&self, table: &str) -> Result<(), InvalidValue> {
        let ways = [self.look_at_m.is_some(), self.has_angles(), self.quaternion_xyzw.is_some()];
        if ways.into_iter().filter(|&used| used).count() < 2 {
            return Ok(());
        }
        let cause = "expected look_at_m, yaw_deg/pitch_deg/roll_deg or quaternion_xyzw, found \
                     several of them";
        Err(InvalidValue::new(table, cause))
    }
}

fn all_finite<const N: usize>(key: &str, values: [f64; N]) -> Result<[f64; N], InvalidValue> {
    values.into_iter().try_for_each(|value| finite(key, value))?;
    Ok(values)
}

fn quaternion(key: &str, xyzw: [f64; 4]) -> Result<DQuat, InvalidValue> {
    let pose = Pose::rigid([0.0; 3], all_finite(key, xyzw)?);
    pose.map(|pose| pose.rotation).map_err(|invalid| InvalidValue::new(key, invalid.cause))
}
