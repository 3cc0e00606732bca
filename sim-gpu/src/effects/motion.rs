//! A sensor in uniform motion during a scan.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};
use crate::pose::{Pose, Trajectory};

/// The uniform motion of a sensor without a trajectory. Points are motion-distorted, as a driver
/// that ignores ego-motion reports them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with velocity_m_s and yaw_rate_deg_s")]
pub struct EvenMotion {
    /// The velocity in the sensor's frame at the start of the scan, metres per second.
    #[serde(default)]
    pub velocity_m_s: [f64; 3],
    /// The yaw rate about the sensor's z axis, to the left, degrees per second.
    #[serde(default)]
    pub yaw_rate_deg_s: f64,
}

/// The largest turn between two poses, degrees, so that interpolation turns the right way.
const TURN_DEG: f64 = 45.0;

impl EvenMotion {
    /// The poses between two times of a sensor that is at `pose` at the first.
    #[must_use]
    pub fn trajectory(&self, pose: Pose, [from_s, to_s]: [f64; 2]) -> Trajectory {
        let velocity_m_s = pose.rotation * DVec3::from_array(self.velocity_m_s);
        let seconds = (to_s - from_s).max(1e-3);
        let turns = (self.yaw_rate_deg_s.abs() * seconds / TURN_DEG).ceil().max(1.0) as u32;
        let at = |i: u32| {
            let after_s = seconds * f64::from(i) / f64::from(turns);
            let turned = DQuat::from_rotation_z(self.yaw_rate_deg_s.to_radians() * after_s);
            let position_m = pose.position_m + velocity_m_s * after_s;
            let rotation = (pose.rotation * turned).normalize();
            (from_s + after_s, Pose { position_m, rotation })
        };
        let poses = (0..=turns).map(at).collect();
        Trajectory::new(poses).expect("invariant: checked numbers are finite")
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        for (axis, velocity_m_s) in self.velocity_m_s.into_iter().enumerate() {
            let key = format!("effects.motion.velocity_m_s[{axis}]");
            within(&key, velocity_m_s, -300.0..=300.0)?;
        }
        within("effects.motion.yaw_rate_deg_s", self.yaw_rate_deg_s, -3600.0..=3600.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_straight_and_turns_to_the_left_however_fast() {
        let pose = Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 9.0, 3.0)).unwrap();
        let motion = EvenMotion { velocity_m_s: [10.0, 0.0, 1.0], yaw_rate_deg_s: 3600.0 };
        let trajectory = motion.trajectory(pose, [5.0, 5.1]);
        let at = trajectory.at(5.05);
        // Forward is along y, and half a turn is 0.05 s.
        assert!(at.position_m.distance(DVec3::new(1.0, 2.5, 3.05)) < 1e-12);
        let forward = at.rotation * DVec3::X;
        assert!(forward.distance(DVec3::NEG_Y) < 1e-9, "{forward}");
        let quarter = trajectory.at(5.025).rotation * DVec3::X;
        assert!(quarter.distance(DVec3::NEG_X) < 1e-9, "to the left: {quarter}");
    }
}
