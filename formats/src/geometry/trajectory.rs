//! Poses over time.

use glam::DQuat;

use super::pose::Pose;
use crate::error::InvalidValue;

/// Poses at ascending times. In between, positions are interpolated linearly and rotations along
/// the shortest arc at a constant rate; before the first and after the last, poses are constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory(pub(crate) Vec<(f64, Pose)>);

impl Trajectory {
    /// These poses at these times, seconds.
    ///
    /// # Errors
    /// If there is no pose, times do not ascend, or a number is not finite.
    pub fn new(poses: Vec<(f64, Pose)>) -> Result<Self, InvalidValue> {
        if poses.is_empty() {
            return Err(InvalidValue::new("trajectory", "expected a pose, found none"));
        }
        for (i, (time_s, pose)) in poses.iter().enumerate() {
            let key = || format!("trajectory[{i}]");
            let is_finite = pose.position_m.is_finite() && pose.rotation.is_finite();
            if !(time_s.is_finite() && is_finite) {
                return Err(InvalidValue::new(key(), "expected finite numbers"));
            }
            if i > 0 && *time_s <= poses[i - 1].0 {
                let cause = format!("expected a time after {} s, found {time_s} s", poses[i - 1].0);
                return Err(InvalidValue::new(key(), cause));
            }
        }
        Ok(Self(poses))
    }

    /// The pose at this time.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Pose {
        self.between(time_s, DQuat::normalize)
    }

    /// The same, but for the last bits of the rotation: those of the interpolation, whose length is 1 but
    /// for rounding. Recordings of live objects keep them.
    #[must_use]
    pub fn at_unnormalized(&self, time_s: f64) -> Pose {
        self.between(time_s, |rotation| rotation)
    }

    fn between(&self, time_s: f64, finish: impl Fn(DQuat) -> DQuat) -> Pose {
        let poses = &self.0;
        let after = poses.partition_point(|(at_s, _)| *at_s <= time_s);
        let (Some((from_s, a)), Some((to_s, b))) =
            (poses.get(after.wrapping_sub(1)), poses.get(after))
        else {
            let end = if after == 0 { poses.first() } else { poses.last() };
            return end.expect("invariant: there is a pose").1;
        };
        let share = (time_s - from_s) / (to_s - from_s);
        Pose {
            position_m: a.position_m.lerp(b.position_m, share),
            rotation: finish(a.rotation.slerp(b.rotation, share)),
        }
    }

    /// Bounds of the distance, metres, and turn, radians, from the pose at `from_s` until `to_s`.
    #[must_use]
    pub fn reach(&self, from_s: f64, to_s: f64) -> (f64, f64) {
        let start = self.at(from_s);
        let between = self.0.iter().filter(|(at_s, _)| (from_s..to_s).contains(at_s));
        let poses: Vec<Pose> = between.map(|(_, pose)| *pose).chain([self.at(to_s)]).collect();
        let mut turned_rad = 0.0;
        let (mut far_m, mut before) = (0.0f64, start);
        for pose in poses {
            // The distance along a line is largest at one of its ends, and a turn is at most the
            // sum of its parts.
            far_m = far_m.max(pose.position_m.distance(start.position_m));
            turned_rad += before.rotation.angle_between(pose.rotation);
            before = pose;
        }
        (far_m, turned_rad)
    }

    /// The poses with their times, seconds, ascending; at least one.
    #[must_use]
    pub fn poses(&self) -> &[(f64, Pose)] {
        &self.0
    }

    /// The times of the first and the last pose, seconds.
    #[must_use]
    pub fn known_s(&self) -> [f64; 2] {
        [self.0[0].0, self.0[self.0.len() - 1].0]
    }
}
