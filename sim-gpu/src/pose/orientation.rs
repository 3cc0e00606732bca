//! The three ways to write an orientation in TOML.

use glam::{DQuat, DVec3};

use super::Pose;
use crate::config::{InvalidValue, finite};

/// The keys that may state an orientation, as read; at most one way at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct OrientationKeys {
    /// The point to look at, metres.
    pub look_at_m: Option<[f64; 3]>,
    /// Angle about z, counterclockwise seen from above, applied last.
    pub yaw_deg: Option<f64>,
    /// Angle about y; positive turns the x axis down.
    pub pitch_deg: Option<f64>,
    /// Angle about x, applied first.
    pub roll_deg: Option<f64>,
    /// A rotation, of any length but 0.
    pub quaternion_xyzw: Option<[f64; 4]>,
}

impl OrientationKeys {
    /// The pose of a sensor, which must state its orientation. `table` is the
    /// path of the TOML table, for errors.
    ///
    /// # Errors
    ///
    /// If none or more than one way is used, or a number cannot be.
    pub fn pose(&self, table: &str, position_m: [f64; 3]) -> Result<Pose, InvalidValue> {
        let position_m = vector(&format!("{table}.position_m"), position_m)?;
        if let Some(target_m) = self.look_at_m {
            self.only_one_way(table)?;
            let target_m = vector(&format!("{table}.look_at_m"), target_m)?;
            return Pose::look_at(position_m, target_m)
                .map_err(|e| InvalidValue::new(format!("{table}.{}", e.key), e.cause));
        }
        let world_from_sensor = self.rotation(table)?.ok_or_else(|| {
            let cause =
                "no orientation: give look_at_m, yaw_deg/pitch_deg/roll_deg or quaternion_xyzw";
            InvalidValue::new(table, cause)
        })?;
        Ok(Pose { position_m, world_from_sensor })
    }

    /// The rotation by angles or by quaternion, `None` if neither is stated.
    ///
    /// # Errors
    ///
    /// If both ways are used, or a number cannot be.
    pub fn rotation(&self, table: &str) -> Result<Option<DQuat>, InvalidValue> {
        self.only_one_way(table)?;
        if let Some(xyzw) = self.quaternion_xyzw {
            return quaternion(&format!("{table}.quaternion_xyzw"), xyzw).map(Some);
        }
        if !self.has_angles() {
            return Ok(None);
        }
        let radians = |key: &str, degrees: Option<f64>| {
            Ok(finite(&format!("{table}.{key}"), degrees.unwrap_or(0.0))?.to_radians())
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
        let cause = "look_at_m, yaw_deg/pitch_deg/roll_deg and quaternion_xyzw exclude each other";
        Err(InvalidValue::new(table, cause))
    }
}

/// A vector with three finite coordinates.
pub(crate) fn vector(key: &str, xyz: [f64; 3]) -> Result<DVec3, InvalidValue> {
    for value in xyz {
        finite(key, value)?;
    }
    Ok(DVec3::from_array(xyz))
}

fn quaternion(key: &str, xyzw: [f64; 4]) -> Result<DQuat, InvalidValue> {
    for value in xyzw {
        finite(key, value)?;
    }
    let largest = xyzw.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    if largest == 0.0 {
        return Err(InvalidValue::new(key, "is zero, which is no rotation"));
    }
    // Scaled first, so that no square overflows or vanishes.
    Ok(DQuat::from_array(xyzw.map(|value| value / largest)).normalize())
}
