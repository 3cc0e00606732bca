//! How the sensor moves.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

/// Where the sensor is, and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// In the world, metres.
    pub position_m: DVec3,
    /// From the sensor's frame to the world's.
    pub world_from_sensor: DQuat,
}

impl Pose {
    /// A point of the sensor's frame in the world.
    #[must_use]
    pub fn to_world(&self, point_m: DVec3) -> DVec3 {
        self.world_from_sensor * point_m + self.position_m
    }

    /// A point of the world in the sensor's frame.
    #[must_use]
    pub fn from_world(&self, point_m: DVec3) -> DVec3 {
        self.world_from_sensor.inverse() * (point_m - self.position_m)
    }
}

/// The motion of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum EgoMotion {
    /// A steady one, in the sensor's frame; the world's frame is the sensor's at the first packet.
    Twist {
        /// Metres a second.
        linear_m_s: DVec3,
        /// Radians a second.
        angular_rad_s: DVec3,
    },
    /// Poses at times of Unix time, ascending; in between they are interpolated, before the first
    /// and after the last they stay.
    Poses(Vec<(f64, Pose)>),
}

/// A file of poses that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EgoMotionError {
    /// It cannot be read.
    #[error("{}", .file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// What the system reports.
        source: std::io::Error,
    },
    /// It makes no sense.
    #[error("{}: line {line}: {cause}", .file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// "expected A, found B".
        cause: String,
    },
}

impl EgoMotion {
    /// Reads a trajectory in TUM's format: lines of a time in seconds, x y z in metres, and
    /// a quaternion qx qy qz qw, separated by blanks; lines that begin with `#` are
    /// comments (<https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats>).
    ///
    /// # Errors
    /// A file that cannot be read; a line that is no pose, or earlier than the one before; no
    /// pose at all.
    pub fn read_tum(file: &Path) -> Result<Self, EgoMotionError> {
        let io = |source| EgoMotionError::Io { file: file.to_path_buf(), source };
        let text = std::fs::read_to_string(file).map_err(io)?;
        let flaw = |line: usize, cause: &dyn Display| EgoMotionError::Malformed {
            file: file.to_path_buf(),
            line,
            cause: cause.to_string(),
        };
        let mut poses: Vec<(f64, Pose)> = Vec::new();
        for (line, text) in (1..).zip(text.lines()) {
            if text.trim().is_empty() || text.trim_start().starts_with('#') {
                continue;
            }
            let (time_s, pose) = pose_of(text).map_err(|cause| flaw(line, &cause))?;
            if let Some((before_s, _)) = poses.last().filter(|(before_s, _)| time_s <= *before_s) {
                let cause = format!("expected a time after {before_s} s, found {time_s} s");
                return Err(flaw(line, &cause));
            }
            poses.push((time_s, pose));
        }
        if poses.is_empty() {
            return Err(flaw(1, &"expected a pose, found none in the file"));
        }
        Ok(Self::Poses(poses))
    }

    /// The pose at `time_s` of Unix time, for a sensor whose first packet is of `start_s`.
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

    /// From when to when poses are known; `None` of a steady motion.
    #[must_use]
    pub fn known_s(&self) -> Option<[f64; 2]> {
        match self {
            Self::Twist { .. } => None,
            Self::Poses(poses) => Some([poses.first()?.0, poses.last()?.0]),
        }
    }
}

/// Where a steady motion leads within `time_s`: the exponential of the twist.
fn moved(linear_m_s: DVec3, angular_rad_s: DVec3, time_s: f64) -> Pose {
    let (v, w) = (linear_m_s * time_s, angular_rad_s * time_s);
    let angle = w.length();
    // Below this, the terms that are left out are below rounding.
    let (a, b) = if angle < 1e-6 {
        (0.5, 1.0 / 6.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    let turned = w.cross(v);
    Pose {
        position_m: v + a * turned + b * w.cross(turned),
        world_from_sensor: DQuat::from_scaled_axis(w),
    }
}

fn pose_of(line: &str) -> Result<(f64, Pose), String> {
    let numbers: Vec<f64> = line
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()).ok_or(word))
        .collect::<Result<_, _>>()
        .map_err(|word| format!("expected a number, found {word:?}"))?;
    let &[time_s, x, y, z, qx, qy, qz, qw] = &numbers[..] else {
        return Err(format!(
            "expected 8 numbers (time, x y z, qx qy qz qw), found {}",
            numbers.len()
        ));
    };
    let quaternion = DQuat::from_xyzw(qx, qy, qz, qw);
    let length = quaternion.length();
    // Files have six digits at times.
    if (length - 1.0).abs() > 1e-3 {
        return Err(format!("expected a quaternion of length 1, found length {length}"));
    }
    let position_m = DVec3::new(x, y, z);
    Ok((time_s, Pose { position_m, world_from_sensor: quaternion.normalize() }))
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

    fn read(text: &str) -> Result<EgoMotion, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let name = file.path().display().to_string();
        EgoMotion::read_tum(file.path()).map_err(|error| error.to_string().replace(&name, "f"))
    }

    #[test]
    fn poses_are_interpolated_and_stay_beyond_their_ends() {
        let text = "# time x y z q\n1 0 0 0 0 0 0 1\n\n3 2 0 4 0 0 1 0\n";
        let motion = read(text).unwrap();
        let pose = motion.pose(2.0, 0.0);
        assert!(pose.position_m.distance(DVec3::new(1.0, 0.0, 2.0)) < 1e-12);
        assert!((pose.world_from_sensor * DVec3::X).distance(DVec3::Y) < 1e-12);
        assert_eq!(motion.pose(-7.0, 0.0).position_m, DVec3::ZERO);
        assert_eq!(motion.pose(9.0, 0.0).position_m, DVec3::new(2.0, 0.0, 4.0));
        assert_eq!(motion.known_s(), Some([1.0, 3.0]));
    }

    #[test]
    fn a_line_that_is_no_pose_is_named() {
        let cases = [
            ("", "f: line 1: expected a pose, found none in the file"),
            ("1 2 3\n", "f: line 1: expected 8 numbers (time, x y z, qx qy qz qw), found 3"),
            ("1 0 0 0 0 0 0 x", "f: line 1: expected a number, found \"x\""),
            ("1 0 nan 0 0 0 0 1", "f: line 1: expected a number, found \"nan\""),
            ("1 0 0 0 0 0 0 2", "f: line 1: expected a quaternion of length 1, found length 2"),
            ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "f: line 2: expected a time after 2 s, found 1 s"),
        ];
        for (text, expected) in cases {
            assert_eq!(read(text).unwrap_err(), expected);
        }
    }
}
