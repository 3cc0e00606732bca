use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use super::*;

/// Sines, cosines and a quaternion's round trip each err by some 1e-16.
const TOLERANCE: f64 = 2e-15;

fn assert_near(found: DVec3, expected: DVec3) {
    assert!(found.abs_diff_eq(expected, TOLERANCE), "{found} is not {expected}");
}

fn axes(pose: &Pose) -> [DVec3; 3] {
    [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| pose.rotation * axis)
}

#[test]
fn a_level_look_is_a_turn_about_z() {
    let pose = Pose::look_at(DVec3::new(3.0, 0.0, 1.0), DVec3::new(0.0, 0.0, 1.0)).unwrap();
    let [forward, left, up] = axes(&pose);
    assert_near(forward, DVec3::NEG_X);
    assert_near(left, DVec3::NEG_Y);
    assert_near(up, DVec3::Z);
}

#[test]
fn a_sensor_above_tilts_down_and_stays_level_to_the_side() {
    let pose = Pose::view(2.0, FRAC_PI_4, 0.3, DVec3::ZERO);
    let [forward, left, up] = axes(&pose);
    assert_near(forward, -pose.position_m / 2.0);
    assert!(left.z.abs() < TOLERANCE);
    assert!(up.z > 0.7);
    assert_near(forward.cross(left), up);
}

#[test]
fn a_view_straight_from_above_or_below_is_turned_by_its_azimuth() {
    for elevation_rad in [FRAC_PI_2, -FRAC_PI_2] {
        for azimuth_rad in [0.0_f64, 1.0, -2.5] {
            let [forward, left, up] =
                axes(&Pose::view(3.0, elevation_rad, azimuth_rad, DVec3::ZERO));
            let (sin_azimuth, cos_azimuth) = azimuth_rad.sin_cos();
            assert_near(forward, DVec3::new(0.0, 0.0, -elevation_rad.signum()));
            assert_near(left, DVec3::new(sin_azimuth, -cos_azimuth, 0.0));
            assert_near(forward.cross(left), up);
        }
    }
}

#[test]
fn looking_straight_down_is_the_view_along_azimuth_0() {
    for z in [5.0, -5.0] {
        let looked = Pose::look_at(DVec3::new(1.0, 2.0, z), DVec3::new(1.0, 2.0, 0.0)).unwrap();
        let viewed = Pose::view(5.0, FRAC_PI_2.copysign(z), 0.0, DVec3::ZERO);
        for (a, b) in axes(&looked).into_iter().zip(axes(&viewed)) {
            assert_near(a, b);
        }
    }
}

#[test]
fn a_view_equals_looking_at_its_target() {
    for azimuth_rad in [0.1, 1.0, 1.9, 2.8, 3.7, 4.6, 5.5] {
        let view = Pose::view(3.0, 0.35, azimuth_rad, DVec3::ZERO);
        let looked = Pose::look_at(view.position_m, DVec3::ZERO).unwrap();
        for (a, b) in axes(&view).into_iter().zip(axes(&looked)) {
            assert_near(a, b);
        }
    }
}

#[test]
fn a_far_target_turns_no_view() {
    let target_m = DVec3::new(1e7, -1e7, 1e7);
    for azimuth_rad in [0.0, FRAC_PI_2, 3.0, -FRAC_PI_2] {
        let [near, far] =
            [DVec3::ZERO, target_m].map(|target_m| Pose::view(3.0, 0.35, azimuth_rad, target_m));
        assert_eq!(near.rotation, far.rotation);
        // Half a unit in the last place at 1e7 is 9.3e-10 m.
        assert!((far.position_m - target_m).abs_diff_eq(near.position_m, 1e-9));
    }
}

#[test]
fn look_at_refuses_what_has_no_direction() {
    let huge = DVec3::splat(f64::MAX);
    for (position_m, target_m, key) in [
        (DVec3::ONE, DVec3::ONE, "look_at_m"),
        (DVec3::NAN, DVec3::ONE, "position_m"),
        (DVec3::ONE, DVec3::new(f64::INFINITY, 0.0, 0.0), "look_at_m"),
        (huge, -huge, "look_at_m"),
    ] {
        assert_eq!(Pose::look_at(position_m, target_m).unwrap_err().key, key);
    }
    let tiny = DVec3::new(0.0, f64::MIN_POSITIVE / 4.0, 0.0);
    let [forward, ..] = axes(&Pose::look_at(DVec3::ZERO, tiny).unwrap());
    assert_near(forward, DVec3::Y);
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
         quaternion_xyzw = [0, 0.7653668647301796, 0, 1.8477590650225735]\n",
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
fn poses_survive_a_round_trip_through_json() {
    let pose = Pose::view(3.0, 0.3, 0.7, DVec3::ONE);
    let json = serde_json::to_string(&pose).unwrap();
    assert!(json.contains("quaternion_xyzw"), "{json}");
    assert_eq!(serde_json::from_str::<Pose>(&json).unwrap(), pose);
}

#[test]
fn bad_poses_are_named() {
    for (keys, part) in [
        ("look_at_m = [1, 2, 3]", "pose[0].look_at_m: expected another point"),
        ("look_at_m = [1, 2, nan]", "pose[0].look_at_m"),
        ("quaternion_xyzw = [0, 0, 0, 0]", "pose[0].quaternion_xyzw: expected a rotation"),
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
