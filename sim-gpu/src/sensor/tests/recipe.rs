//! The steps of ModelNet40-C's lidar corruption, and recommended views.

use formats::rng::StreamKey;
use glam::DVec3;

use super::*;
use crate::mesh::frame::Normalize;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn rings() -> Rings {
    sensor("modelnet40c-lidar").rings.unwrap()
}

fn at_polar(polar_deg: f64, azimuth_rad: f64) -> DVec3 {
    let (sin_polar, cos_polar) = (polar_deg * DEGREE).sin_cos();
    DVec3::new(sin_polar * azimuth_rad.cos(), sin_polar * azimuth_rad.sin(), cos_polar)
}

#[test]
fn the_middle_of_a_ring_is_kept_and_snapped() {
    let first_polar_rad = 80.3 * DEGREE;
    for (steps, snapped) in [
        (0.0, None),
        (0.24, None),
        (0.26, Some(0.5)),
        (0.5, Some(0.5)),
        (0.74, Some(0.5)),
        (0.76, None),
        (7.3, Some(7.5)),
        (7.9, None),
    ] {
        let found = rings().snap_to_ring(at_polar(80.3 + steps, -2.0), first_polar_rad);
        let expected = snapped.map(|steps| at_polar(80.3 + steps, -2.0));
        match (found, expected) {
            (Some(found), Some(expected)) => {
                assert!(found.abs_diff_eq(expected, 1e-14), "{steps}: {found} is not {expected}");
            }
            (found, expected) => assert_eq!(found, expected, "{steps}"),
        }
    }
}

#[test]
fn a_point_moves_by_at_most_a_quarter_step() {
    for i in 0..1000 {
        let direction = at_polar(0.1 + f64::from(i) * 0.179, f64::from(i));
        let Some(snapped) = rings().snap_to_ring(direction, 0.0) else { continue };
        assert!((snapped.length() - 1.0).abs() < 1e-15);
        // At D = 5 that is the 22 mm of SIMULATORS.md section 6.
        assert!(direction.angle_between(snapped) < 0.25 * DEGREE + 1e-12);
    }
}

#[test]
fn polar_angles_reach_from_pole_to_pole() {
    assert_eq!(polar_angle_rad(DVec3::Z), 0.0);
    assert_eq!(polar_angle_rad(DVec3::NEG_Z), std::f64::consts::PI);
    assert_eq!(polar_angle_rad(DVec3::NEG_X * 5.0), std::f64::consts::FRAC_PI_2);
}

#[test]
fn draws_are_many_as_asked_and_in_range() {
    let key = StreamKey::new(2021, "chair_0890", 1);
    let sample = sensor("modelnet40c-lidar").sample.unwrap();
    let drawn = sample.draw(500, key);
    assert_eq!(drawn.len(), 768);
    assert!(drawn.iter().all(|&i| i < 500));
    assert_eq!(drawn, sample.draw(500, key));
    assert!(sample.draw(0, key).is_empty());
    assert!(sample.draw_before_rings(0, key).is_empty());
    assert_eq!(sample.draw_before_rings(3, key).len(), 1024);

    let mut without = sample.draw_before_rings(5000, key);
    without.sort_unstable();
    without.dedup();
    assert_eq!(without.len(), 1024);
    let all = Sample { points: 9, with_replacement: false, before_rings: None };
    let mut few = all.draw(4, key);
    few.sort_unstable();
    assert_eq!(few, [0, 1, 2, 3]);
    assert_eq!(all.draw_before_rings(3, key), [0, 1, 2]);
}

#[test]
fn the_recipe_looks_from_five_sectors_of_72_degrees() {
    let views = sensor("modelnet40c-lidar").default_views();
    assert_eq!(views.normalize, Some(Normalize::Bbox));
    let poses = views.poses(DVec3::ZERO, StreamKey::new(1, "cup_0001", 0));
    assert_eq!(poses.len(), 5);
    assert_ne!(poses, views.poses(DVec3::ZERO, StreamKey::new(2, "cup_0001", 0)));
    for (pose, s) in poses.iter().zip(1u8..) {
        assert!((pose.position_m.length() - 5.0).abs() < 1e-14);
        assert!((pose.position_m.z - 5.0 * (22.5 * DEGREE).sin()).abs() < 1e-14);
        // lidar_pose(theta) stands at -5 Rz(theta) (0, -sin, cos): theta + 90.
        let sector = 72.0 * f64::from(s) + 90.0;
        let azimuth = pose.position_m.y.atan2(pose.position_m.x).to_degrees();
        let off_centre = (azimuth - sector + 180.0).rem_euclid(360.0) - 180.0;
        assert!(off_centre.abs() <= 36.0 + 1e-12, "{s}: {azimuth}");
    }
}

#[test]
fn sensors_without_views_of_their_own_have_the_usual_ones() {
    assert_eq!(sensor("vlp32c").default_views(), Views::ROTATING);
    assert_eq!(sensor("blainder-ultrapuck").default_views(), Views::ROTATING);
    assert_eq!(sensor("generic-static").default_views(), Views::STATIC);
    let poses = Views::ROTATING.poses(DVec3::ZERO, StreamKey::new(0, "", 0));
    let expected = DVec3::new((20.0 * DEGREE).cos(), 0.0, (20.0 * DEGREE).sin()) * 3.0;
    assert_eq!(poses.len(), 4);
    assert!(poses[0].position_m.abs_diff_eq(expected, 1e-15));
    assert!(poses[1].position_m.y > 2.8);
}
