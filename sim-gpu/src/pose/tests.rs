use glam::DVec3;

use super::*;

/// Sines, cosines and a quaternion's round trip each err by some 1e-16.
const TOLERANCE: f64 = 2e-15;

fn assert_near(found: DVec3, expected: DVec3) {
    assert!(found.abs_diff_eq(expected, TOLERANCE), "{found} is not {expected}");
}

fn axes(pose: &Pose) -> [DVec3; 3] {
    [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| pose.rotation * axis)
}

fn parse(text: &str) -> Result<Vec<Pose>, ConfigError> {
    config::parse(text, Path::new("poses.toml"), poses)
}

#[test]
fn all_three_ways_state_the_same_orientation() {
    let poses = parse(
        "[[pose]]\nposition_m = [0, 0, 3]\nlook_at_m = [3, 0, 0]\n\
         [[pose]]\nposition_m = [0, 0, 3]\nyaw_deg = 0\npitch_deg = 45\n\
         [[pose]]\nposition_m = [0, 0, 3]\n\
         quaternion_xyzw = [0, 0.3826834323650898, 0, 0.9238795325112867]\n",
    )
    .unwrap();
    let first = axes(&poses[0]);
    assert_near(first[0], DVec3::new(1.0, 0.0, -1.0).normalize());
    for pose in &poses[1..] {
        for (a, b) in axes(pose).into_iter().zip(first) {
            assert_near(a, b);
        }
    }
}

#[test]
fn roll_comes_first_and_yaw_last() {
    let poses =
        parse("[[pose]]\nposition_m = [0, 0, 0]\nyaw_deg = 90\npitch_deg = 30\nroll_deg = 90")
            .unwrap();
    let [forward, left, _] = axes(&poses[0]);
    assert_near(forward, DVec3::new(0.0, 30_f64.to_radians().cos(), -0.5));
    assert_near(left, DVec3::new(0.0, 0.5, 30_f64.to_radians().cos()));
}

#[test]
fn bad_poses_are_named() {
    for (keys, part) in [
        ("look_at_m = [1, 2, 3]", "pose[0].look_at_m: expected another point"),
        ("look_at_m = [1, 2, nan]", "pose[0].look_at_m"),
        (
            "quaternion_xyzw = [0, 0, 0, 0]",
            "pose[0].quaternion_xyzw: expected a quaternion of length 1",
        ),
        ("quaternion_xyzw = [0, 0, inf, 0]", "pose[0].quaternion_xyzw"),
        ("yaw_deg = nan", "pose[0].yaw_deg"),
        (
            "",
            "pose[0]: expected look_at_m, yaw_deg/pitch_deg/roll_deg or quaternion_xyzw, found none",
        ),
        ("yaw_deg = 1\nlook_at_m = [0, 0, 0]", "found several of them"),
        ("yaw = 1", "yaw"),
        ("quaternion_xyzw = [0, 0, 1]", "quaternion_xyzw"),
    ] {
        let error = parse(&format!("[[pose]]\nposition_m = [1, 2, 3]\n{keys}\n")).unwrap_err();
        let message = error.to_string();
        assert!(message.contains(part) && message.contains("poses.toml"), "{keys}: {message}");
    }
    let error = parse("[[pose]]\nposition_m = [1, inf, 3]\nyaw_deg = 0").unwrap_err();
    assert!(error.to_string().contains("pose[0].position_m"), "{error}");
    let error = parse("").unwrap_err().to_string();
    assert!(error.ends_with("pose: expected at least one [[pose]], found none"), "{error}");
}

#[test]
fn a_missing_file_is_named() {
    let error = load_poses(Path::new("no/such/poses.toml")).unwrap_err();
    assert!(error.to_string().contains("no/such/poses.toml"), "{error}");
}
