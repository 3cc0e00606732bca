use std::path::Path;

use formats::FormatError;
use formats::trajectory::{
    KeyedPose, check_cover, doubtful_rotation, doubtful_speed, read_trajectory,
};
use glam::{DQuat, DVec3};

/// The position and orientation of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The position in the world, metres.
    pub position_m: DVec3,
    /// The rotation from the sensor's frame to the world's.
    pub world_from_sensor: DQuat,
}

impl Pose {
    /// Transforms a point from the sensor's frame to the world's.
    #[must_use]
    pub fn to_world(&self, point_m: DVec3) -> DVec3 {
        self.world_from_sensor * point_m + self.position_m
    }

    /// Transforms a point from the world's frame to the sensor's.
    #[must_use]
    pub fn from_world(&self, point_m: DVec3) -> DVec3 {
        self.world_from_sensor.inverse() * (point_m - self.position_m)
    }
}

/// The motion of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum EgoMotion {
    /// A constant twist in the sensor's frame. The world's frame is the sensor's frame at the first
    /// packet.
    Twist {
        /// Metres per second.
        linear_m_s: DVec3,
        /// Radians per second.
        angular_rad_s: DVec3,
    },
    /// Poses with their Unix times, ascending. Between them, poses are interpolated; before the
    /// first and after the last, the pose is constant.
    Poses(Vec<(f64, Pose)>),
}

impl EgoMotion {
    /// Reads a trajectory in TUM's or KITTI's format; KITTI's poses are 0.1 s apart.
    ///
    /// # Errors
    /// As [`read_trajectory`].
    pub fn read(file: &Path) -> Result<Self, FormatError> {
        let pose = |keyed: KeyedPose| {
            let world_from_sensor = DQuat::from_array(keyed.quaternion_xyzw);
            (keyed.time_s, Pose { position_m: keyed.position_m.into(), world_from_sensor })
        };
        Ok(Self::Poses(read_trajectory(file)?.into_iter().map(pose).collect()))
    }

    /// The pose at the Unix time `time_s`, for a sensor with its first packet at `start_s`.
    #[must_use]
    pub fn pose(&self, time_s: f64, start_s: f64) -> Pose {
        match self {
            Self::Twist { linear_m_s, angular_rad_s } => {
                moved(*linear_m_s, *angular_rad_s, time_s - start_s)
            }
            Self::Poses(poses) => {
                let after = poses.partition_point(|(at_s, _)| *at_s <= time_s);
                let (Some(a), Some(b)) = (poses.get(after.wrapping_sub(1)), poses.get(after))
                else {
                    let end = if after == 0 { poses.first() } else { poses.last() };
                    return end.expect("invariant: there is a pose").1;
                };
                let share = (time_s - a.0) / (b.0 - a.0);
                Pose {
                    position_m: a.1.position_m.lerp(b.1.position_m, share),
                    world_from_sensor: a.1.world_from_sensor.slerp(b.1.world_from_sensor, share),
                }
            }
        }
    }

    /// Checks that the poses cover packets that were sent from the first to the second of these
    /// Unix times, seconds, to within a turn. A twist and a single pose cover all times.
    ///
    /// # Errors
    /// Both spans, and what the times of the poses seem to be.
    pub fn check_cover(&self, sent_s: [f64; 2]) -> Result<(), String> {
        self.known_s().map_or(Ok(()), |known_s| check_cover(known_s, sent_s))
    }

    /// Why the poses are probably not those of a sensor on the ground, in metres and seconds; empty
    /// if nothing speaks against it.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let Self::Poses(poses) = self else { return Vec::new() };
        if poses.len() == 1 {
            return vec!["there is one pose: the sensor is taken to stand still there".into()];
        }
        let keyed = poses.iter().map(|(time_s, pose)| KeyedPose {
            time_s: *time_s,
            position_m: pose.position_m.into(),
            quaternion_xyzw: pose.world_from_sensor.into(),
        });
        let keyed: Vec<_> = keyed.collect();
        let found = [doubtful_speed, doubtful_rotation].map(|doubt| doubt("the sensor", &keyed));
        let mut doubts: Vec<String> = found.into_iter().flatten().collect();
        let steps = poses.windows(2).map(|pair| (pair[0].0, pair[1].0 - pair[0].0));
        if let Some((at_s, gap_s)) = steps.max_by(|a, b| a.1.total_cmp(&b.1))
            && gap_s > LONGEST_GAP_S
        {
            doubts.push(format!(
                "there is no pose for {gap_s:.3} s after {at_s} s: between two poses the sensor is \
                 taken to move straight on"
            ));
        }
        doubts
    }

    /// The times of the first and the last pose; `None` for a twist.
    #[must_use]
    pub fn known_s(&self) -> Option<[f64; 2]> {
        match self {
            Self::Twist { .. } => None,
            Self::Poses(poses) => Some([poses.first()?.0, poses.last()?.0]),
        }
    }
}

/// Longer than the steps of odometry, GPS and SLAM, seconds.
const LONGEST_GAP_S: f64 = 1.0;

/// The pose after `time_s` of constant motion: the exponential of the twist.
fn moved(linear_m_s: DVec3, angular_rad_s: DVec3, time_s: f64) -> Pose {
    let (v, w) = (linear_m_s * time_s, angular_rad_s * time_s);
    let angle = w.length();
    // Below this angle, the omitted terms are below rounding.
    let (a, b) = if angle < 1e-6 {
        (0.5, 1.0 / 6.0)
    } else {
        ((1.0 - libm::cos(angle)) / angle.powi(2), (angle - libm::sin(angle)) / angle.powi(3))
    };
    let turned = w.cross(v);
    Pose {
        position_m: v + a * turned + b * w.cross(turned),
        world_from_sensor: DQuat::from_scaled_axis(w),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_turn_is_a_circle() {
        let twist = EgoMotion::Twist { linear_m_s: DVec3::X * 2.0, angular_rad_s: DVec3::Z * 0.5 };
        let pose = twist.pose(10.0 + std::f64::consts::PI, 10.0);
        // A quarter of a circle of radius 4 m.
        assert!(pose.position_m.distance(DVec3::new(4.0, 4.0, 0.0)) < 1e-12, "{pose:?}");
        assert!((pose.to_world(DVec3::X) - DVec3::new(4.0, 5.0, 0.0)).length() < 1e-12);
        let there_and_back = pose.from_world(pose.to_world(DVec3::ONE));
        assert!((there_and_back - DVec3::ONE).length() < 1e-12);
        assert_eq!(twist.pose(10.0, 10.0).position_m, DVec3::ZERO);
    }

    fn read(text: &str) -> EgoMotion {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        EgoMotion::read(file.path()).unwrap()
    }

    #[test]
    fn poses_of_other_units_orders_and_steps_are_doubted() {
        for (text, expected) in [
            ("0 0 0 0 0 0 0 1\n0.1 2 0 0 0 0 0 1\n", None),
            ("0 0 0 0 0 0 0 1\n0.1 2000 0 0 0 0 0 1\n", Some("20000 m/s at 0 s")),
            ("0 0 0 0 1 0 0 0\n0.1 2 0 0 1 0 0 0\n", Some("on its head")),
            ("0 0 0 0 0 0 0 1\n", Some("there is one pose")),
            ("0 0 0 0 0 0 0 1\n2.5 2 0 0 0 0 0 1\n", Some("no pose for 2.500 s after 0 s")),
        ] {
            let doubts = read(text).doubts();
            assert_eq!(doubts.len(), usize::from(expected.is_some()), "{doubts:?}");
            assert!(doubts.concat().contains(expected.unwrap_or_default()), "{doubts:?}");
        }
    }

    #[test]
    fn poses_are_interpolated_and_stay_beyond_their_ends() {
        let text = "# time x y z q\n1 0 0 0 0 0 0 1\n\n3 2 0 4 0 0 1 0\n";
        let motion = read(text);
        let pose = motion.pose(2.0, 0.0);
        assert!(pose.position_m.distance(DVec3::new(1.0, 0.0, 2.0)) < 1e-12);
        assert!((pose.world_from_sensor * DVec3::X).distance(DVec3::Y) < 1e-12);
        assert_eq!(motion.pose(-7.0, 0.0).position_m, DVec3::ZERO);
        assert_eq!(motion.pose(9.0, 0.0).position_m, DVec3::new(2.0, 0.0, 4.0));
        assert_eq!(motion.known_s(), Some([1.0, 3.0]));
    }
}
