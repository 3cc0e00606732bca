//! Whether poses over time are those of things on the ground, in metres and seconds.

use super::Warning;
use crate::geometry::{Pose, Trajectory};

/// Faster than cars, metres per second.
const FASTEST_M_S: f64 = 100.0;

/// Longer than the steps of odometry, GPS and SLAM, seconds.
const LONGEST_GAP_S: f64 = 1.0;

/// Why `motion` is probably not that of a sensor that drives.
#[must_use]
pub fn sensor_motion(motion: &Trajectory) -> Vec<Warning> {
    let poses = motion.poses();
    if poses.len() == 1 {
        return vec![Warning::OnePose];
    }
    let steps = poses.array_windows().map(|[a, b]| (a.0, b.0 - a.0));
    let longest = steps.max_by(|a, b| a.1.total_cmp(&b.1));
    let gap = longest.filter(|(_, gap_s)| *gap_s > LONGEST_GAP_S);
    let gap = gap.map(|(at_s, gap_s)| Warning::GapInPoses { gap_s, at_s });
    motion_of("the sensor", true, motion).into_iter().chain(gap).collect()
}

/// Why `motion` is probably not that of `what`, such as "the sensor", which may have to be upright.
#[must_use]
pub fn motion_of(what: &str, is_upright: bool, motion: &Trajectory) -> Vec<Warning> {
    let poses = motion.poses().iter().map(|(_, pose)| pose);
    let rotation = is_upright.then(|| upside_down(what, poses)).flatten();
    speed(what, motion).into_iter().chain(rotation).collect()
}

fn speed(what: &str, motion: &Trajectory) -> Option<Warning> {
    let speeds = motion
        .poses()
        .array_windows()
        .map(|[a, b]| (a.1.position_m.distance(b.1.position_m) / (b.0 - a.0), a.0));
    let (speed_m_s, at_s) = speeds.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let what = what.to_owned();
    (speed_m_s > FASTEST_M_S).then_some(Warning::TooFast { what, speed_m_s, at_s })
}

/// Whether most `poses` of `what`, which stands upright, turn it over.
pub fn upside_down<'a>(what: &str, poses: impl IntoIterator<Item = &'a Pose>) -> Option<Warning> {
    // 0.5 is a z axis that is level, and 1 one that points down.
    const MOST: f64 = 0.6;
    let (mut n, mut n_inverted) = (0, 0);
    for pose in poses {
        let [x, y, ..] = pose.rotation.to_array();
        n += 1;
        n_inverted += usize::from(x * x + y * y > MOST);
    }
    (2 * n_inverted > n).then(|| Warning::UpsideDown(what.to_owned()))
}

#[cfg(all(test, feature = "files"))]
mod tests {
    use super::*;

    #[test]
    fn poses_of_other_units_orders_and_steps_are_warnings() {
        for (text, expected) in [
            ("0 0 0 0 0 0 0 1\n0.1 2 0 0 0 0 0 1\n", None),
            ("0 0 0 0 0 0 0 1\n0.1 2000 0 0 0 0 0 1\n", Some("20000 m/s at 0 s")),
            ("0 0 0 0 1 0 0 0\n0.1 2 0 0 1 0 0 0\n", Some("on its head")),
            ("0 0 0 0 0 0 0 1\n", Some("there is one pose")),
            ("0 0 0 0 0 0 0 1\n2.5 2 0 0 0 0 0 1\n", Some("no pose for 2.500 s after 0 s")),
        ] {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), text).unwrap();
            let warnings = sensor_motion(&Trajectory::load(file.path()).unwrap());
            let found: Vec<_> = warnings.iter().map(ToString::to_string).collect();
            assert_eq!(found.len(), usize::from(expected.is_some()), "{found:?}");
            assert!(found.concat().contains(expected.unwrap_or_default()), "{found:?}");
        }
    }
}
