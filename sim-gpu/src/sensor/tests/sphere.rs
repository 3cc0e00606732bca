//! Points on a unit sphere at the sensor's height, level sensor, one sweep:
//! SIMULATORS.md section 4.

use glam::DVec3;

use super::*;

/// Rays of a pattern that hit the unit sphere centred at `distance_m` towards
/// `axis`: those within asin(1 / distance) of it.
fn points(pattern: &BeamPattern, axis: DVec3, distance_m: f64) -> usize {
    let half_angle_rad = (1.0 / distance_m).asin();
    let candidates = pattern.within(&Cone { axis, half_angle_rad });
    let hits = |&&ray: &&u32| axis.dot(pattern.directions[ray as usize]) >= half_angle_rad.cos();
    candidates.iter().filter(hits).count()
}

#[test]
fn the_blainder_preset_puts_its_known_points_on_a_sphere_ahead() {
    let pattern = sensor("blainder-ultrapuck").pattern();
    for (distance_m, expected) in
        [(2.0, 33_808), (3.0, 18_100), (5.0, 6_348), (10.0, 1_568), (20.0, 388)]
    {
        assert_eq!(points(&pattern, DVec3::X, distance_m), expected, "{distance_m} m");
    }
}

/// Where the first ray of each laser falls relative to the sphere is the phase
/// of its azimuth. A laser that crosses a chord of k steps puts floor(k) or
/// ceil(k) points on it, so that no direction of view can differ from the sum
/// of all chords by more than one point for each laser that touches.
#[test]
fn the_vlp32c_puts_its_known_points_on_a_sphere_within_one_a_laser() {
    let pattern = sensor("vlp32c").pattern();
    let Layout::Rotating(rotating) = sensor("vlp32c").layout else { panic!("it rotates") };
    for (distance_m, expected, touching) in
        [(2.0, 9_339, 32), (3.0, 5_754, 31), (5.0, 3_021, 29), (10.0, 1_150, 23), (20.0, 359, 15)]
    {
        let half_angle_deg = (1.0_f64 / distance_m).asin().to_degrees();
        let touches = |beam: &&Beam| beam.elevation_deg.abs() < half_angle_deg;
        assert_eq!(rotating.beam.iter().filter(touches).count(), touching, "{distance_m} m");
        for azimuth_deg in [90.0_f64, 123.4, 200.0] {
            let (y, x) = azimuth_deg.to_radians().sin_cos();
            let found = points(&pattern, DVec3::new(x, y, 0.0), distance_m);
            assert!(found.abs_diff(expected) <= touching, "{distance_m} m: {found}");
        }
    }
}
