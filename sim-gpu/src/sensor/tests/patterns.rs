use glam::DVec3;

use super::*;

/// Products of sines and cosines err by a few units in the last place.
const TOLERANCE: f64 = 1e-15;

fn assert_near(found: DVec3, expected: DVec3) {
    assert!(found.abs_diff_eq(expected, TOLERANCE), "{found} is not {expected}");
}

/// The direction at this elevation and azimuth, counterclockwise, in degrees.
fn at(elevation_deg: f64, azimuth_deg: f64) -> DVec3 {
    let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
    let (sin_azimuth, cos_azimuth) = azimuth_deg.to_radians().sin_cos();
    DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
}

fn elevation_deg(direction: DVec3) -> f64 {
    direction.z.asin().to_degrees()
}

#[test]
fn every_sensor_has_its_number_of_rays() {
    for (name, n_rays) in [
        ("vlp32c", 57_870),              // floor(32 x 0.1 s / 55.296 us)
        ("blainder-ultrapuck", 219_600), // 1800 x 122
        ("generic-static", 10_000),
        ("kinect-v2", 217_088), // 512 x 424
        ("vlp16", 28_935),      // floor(16 x 0.1 s / 55.296 us)
        ("hdl64e", 133_333),    // floor(64 x 0.1 s / 48 us)
        ("vls128", 240_150),    // floor(128 x 0.1 s / 53.3 us)
        ("os0-128", 131_072),   // 128 x 1024
        ("os1-128", 131_072),
        ("os2-128", 131_072),
        ("xt32", 64_000),        // 32 x 2000
        ("pandar64", 115_200),   // 64 x 1800
        ("qt64", 38_400),        // 64 x 600
        ("rs-lidar-32", 57_636), // floor(32 x 0.1 s / 55.52 us)
        ("helios-5515", 57_600), // 32 x 1800
        ("avia", 24_000),        // 6 x 40 kHz x 0.1 s
        ("mid70", 10_000),
        ("ld19", 450),
        ("rplidar-a1", 1_454), // floor(8000 / 5.5)
    ] {
        assert_eq!(sensor(name).pattern().len(), n_rays, "{name}");
    }
}

#[test]
fn every_direction_is_of_unit_length_and_every_ray_once_in_the_order() {
    for name in builtin_names() {
        let pattern = sensor(name).pattern();
        for direction in &pattern.directions {
            assert!((direction.length() - 1.0).abs() < TOLERANCE, "{name}: {direction}");
        }
        let mut order = pattern.order.clone();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..pattern.len() as u32), "{name}");
    }
}

#[test]
fn rings_are_ranked_from_below() {
    for name in builtin_names() {
        // The ring of a line behind prisms is its index, not its elevation.
        if let Layout::Grid(_) | Layout::Risley(_) = sensor(name).layout {
            continue;
        }
        let pattern = sensor(name).pattern();
        let n_rings = usize::from(*pattern.ring.iter().max().unwrap()) + 1;
        let mut elevations_deg = vec![f64::NAN; n_rings];
        for (&ring, &direction) in pattern.ring.iter().zip(&pattern.directions) {
            elevations_deg[usize::from(ring)] = elevation_deg(direction);
        }
        assert!(elevations_deg.is_sorted(), "{name}: {elevations_deg:?}");
    }
}

#[test]
fn the_vlp32c_starts_with_its_first_two_lasers() {
    let pattern = sensor("vlp32c").pattern();
    // Laser 0: offset -1.4 degrees, so 1.4 degrees clockwise. Laser 1: +4.2.
    assert_near(pattern.directions[0], at(-25.0, -1.4));
    assert_near(pattern.directions[1], at(-1.0, 4.2));
    assert_eq!(pattern.time_s[..3], [0.0, 0.0, 2.304e-6]);
    assert_eq!(pattern.ring[0], 0);
    assert_eq!(*pattern.ring.iter().max().unwrap(), 31);
    assert_eq!(elevation_deg(pattern.directions[29]).round(), 15.0);
    assert_eq!(pattern.ring[29], 31);
}

#[test]
fn the_vlp32c_ends_with_the_14th_laser_of_sequence_1808() {
    let pattern = sensor("vlp32c").pattern();
    let time_us = 1808.0 * 55.296 + 6.0 * 2.304;
    // Sums of microseconds up to 1e5 are rounded to 1.5e-11 us.
    assert!((pattern.time_s[57_869] - time_us * 1e-6).abs() < 1e-16);
    // Laser 13: offset +1.4 degrees, elevation 1.333.
    let clockwise_deg = 360.0 * time_us * 1e-6 / 0.1 - 1.4;
    let found = pattern.directions[57_869];
    // Both ways round some ten times by 1.1e-16 of an azimuth of 6.3.
    assert!(found.abs_diff_eq(at(1.333, -clockwise_deg), 1e-14), "{found}");
}

#[test]
fn the_vlp32c_steps_by_a_fifth_of_a_degree_clockwise() {
    let pattern = sensor("vlp32c").pattern();
    let azimuth_deg = |ray: usize| {
        let direction = pattern.directions[ray];
        direction.y.atan2(direction.x).to_degrees()
    };
    // 360 x 10 Hz x 55.296 us; SIMULATORS.md section 3 has 0.19907.
    assert!((azimuth_deg(0) - azimuth_deg(32) - 0.199_065_6).abs() < 1e-12);
    assert!(pattern.time_s.is_sorted());
    assert!(pattern.time_s.iter().all(|&time_s| time_s < 0.1));
}

#[test]
fn a_quantum_rounds_the_starts_of_sequences_alone() {
    let mut coarse = sensor("vlp32c");
    let Layout::Rotating(rotating) = &mut coarse.layout else { panic!("it rotates") };
    rotating.sequence_quantum_deg = Some(0.01);
    let pattern = coarse.pattern();
    // 0.1990656 degrees become 0.20: laser 0 points to -1.4 - 0.2.
    assert_near(pattern.directions[32], at(-25.0, -1.6));
    // The head turns on at 3600 degrees/s.
    assert_near(pattern.directions[34], at(-1.667, -1.4 - 0.2 - 3600.0 * 2.304e-6));
}

#[test]
fn beams_that_cross_before_the_axis_leave_it_below_or_above_the_sensor() {
    let mut real = sensor("vlp32c");
    let Layout::Rotating(rotating) = &mut real.layout else { panic!("it rotates") };
    rotating.beam_crossing_m = Some(0.0424);
    let (pattern, ideal) = (real.pattern(), sensor("vlp32c").pattern());
    assert_eq!(pattern.directions, ideal.directions);
    assert!((0..32).all(|beam| ideal.start(beam).is_none()));
    for beam in 0..pattern.len() as u32 {
        let direction = pattern.directions[beam as usize];
        let start = pattern.start(beam).unwrap();
        let crossing = start + direction * (0.0424 / direction.x.hypot(direction.y));
        assert!(crossing.z.abs() < TOLERANCE, "{beam} passes at {crossing}");
    }
}

#[test]
fn the_blainder_grid_has_its_corners_and_its_seam_twice() {
    let pattern = sensor("blainder-ultrapuck").pattern();
    let [first, last] = [pattern.directions[0], pattern.directions[219_599]];
    assert_near(first, at(-20.0, -180.0));
    assert_near(last, at(20.0, 180.0));
    for row in 0..122 {
        let [first, last] = [row, 1799 * 122 + row].map(|ray| pattern.directions[ray]);
        assert_near(first, last);
    }
    // linspace: 360 / 1799 and 40 / 121 degrees a step, y inner.
    assert_near(pattern.directions[1], at(-20.0 + 40.0 / 121.0, -180.0));
    assert_near(pattern.directions[122], at(-20.0, -180.0 + 360.0 / 1799.0));
    assert_eq!(pattern.ring[..3], [0, 1, 2]);
    assert!((pattern.time_s[219_599] - 0.05).abs() < 1e-17);
}

#[test]
fn a_static_scanner_has_pixel_centres_on_the_edges_of_its_view() {
    let pattern = sensor("generic-static").pattern();
    let edge = 30_f64.to_radians().tan();
    let corner = |left: f64, up: f64| DVec3::new(1.0, left * edge, up * edge).normalize();
    assert_near(pattern.directions[0], corner(1.0, 1.0));
    assert_near(pattern.directions[99], corner(-1.0, 1.0));
    assert_near(pattern.directions[9_900], corner(1.0, -1.0));
    assert_near(pattern.directions[1], corner(1.0 - 2.0 / 99.0, 1.0));
    assert_eq!((pattern.ring[0], pattern.ring[9_999]), (99, 0));
}

#[test]
fn beams_fire_by_time_and_the_last_sequence_is_cut() {
    let pattern = parse(TINY).unwrap().pattern();
    // 2 x 1 s / 0.4 s = 5 rays.
    assert_eq!(pattern.ring, [0, 1, 0, 1, 0]);
    // Sixth decimals of seconds are not binary fractions: a unit in the last place.
    for (found, expected) in pattern.time_s.iter().zip([0.0, 0.1, 0.4, 0.5, 0.8]) {
        assert!((found - expected).abs() < 1e-15);
    }
    assert_near(pattern.directions[0], at(-5.0, -90.0));
}

#[test]
fn decimation_keeps_each_kth_column_as_it_is() {
    for (name, per_column) in [("vlp32c", 32), ("blainder-ultrapuck", 122)] {
        let whole = sensor(name).pattern();
        let kept = sensor(name).decimated(NonZeroU32::new(3).unwrap()).pattern();
        let columns = whole.directions.chunks(per_column).step_by(3);
        assert!(columns.flatten().eq(&kept.directions), "{name}");
        let times = whole.time_s.chunks(per_column).step_by(3);
        assert!(times.flatten().eq(&kept.time_s), "{name}");
    }
    let kept = sensor("generic-static").decimated(NonZeroU32::new(7).unwrap()).pattern();
    assert_eq!(kept.len(), 15 * 100);
    let twice = NonZeroU32::new(2).unwrap();
    assert_eq!(sensor("vlp16").decimated(twice).decimated(twice).decimation.get(), 4);
    assert_eq!(sensor("vlp16").decimated(NonZeroU32::MAX).pattern().len(), 16);
}

/// Blocks of 64 rays traverse a tree together: on the mean they should be no
/// wider than a patch of as many rays at the sensor's own spacing.
#[test]
fn neighbours_in_the_order_point_alike() {
    for name in ["vlp32c", "blainder-ultrapuck", "hdl64e", "kinect-v2"] {
        let pattern = sensor(name).pattern();
        let blocks = pattern.order.chunks(64).map(|block| {
            let first = pattern.directions[block[0] as usize];
            let angles =
                block.iter().map(|&ray| first.angle_between(pattern.directions[ray as usize]));
            angles.fold(0.0, f64::max).to_degrees()
        });
        let n_blocks = blocks.len() as f64;
        let mean_deg = blocks.sum::<f64>() / n_blocks;
        // A square patch of 64 rays of a sensor that spreads n rays over its
        // 360 x 40 degrees (or 70 x 60): its diagonal, and as much again for
        // the bends of the curve and the widest gaps between rings.
        let area_deg2 = if name == "kinect-v2" { 4200.0 } else { 14400.0 };
        let patch_deg = 2.0 * (2.0 * 64.0 * area_deg2 / pattern.len() as f64).sqrt();
        assert!(mean_deg < patch_deg, "{name}: {mean_deg} of {patch_deg} degrees");
    }
}

#[test]
fn beams_that_start_beside_the_axis_start_where_the_encoder_points() {
    let text = TINY.replace("rpm = 60", "rpm = 60\nbeam_start_m = 0.0158");
    let (beside, ideal) = (parse(&text).unwrap().pattern(), parse(TINY).unwrap().pattern());
    assert_eq!(beside.directions, ideal.directions);
    assert!((beside.farthest_start_m() - 0.0158).abs() < 1e-15);
    for (ray, time_s) in (0..).zip(&ideal.time_s) {
        // One turn a second, clockwise.
        let (sine, cosine) = (std::f64::consts::TAU * time_s).sin_cos();
        let expected = DVec3::new(cosine, -sine, 0.0) * 0.0158;
        assert!(beside.start(ray).unwrap().distance(expected) < 1e-12, "{ray}");
    }
}

#[test]
fn more_revolutions_go_on_where_the_first_ends() {
    let five = NonZeroU32::new(5).unwrap();
    for name in ["vlp32c", "os1-128", "avia"] {
        let (one, all) = (sensor(name), sensor(name).with_revolutions(five).unwrap());
        let (one, all) = (one.pattern(), all.pattern());
        assert!(all.len() >= 5 * one.len(), "{name}");
        assert_eq!(all.directions[..one.len()], one.directions[..], "{name}");
        assert_eq!(all.time_s[..one.len()], one.time_s[..], "{name}");
        assert!(all.time_s.is_sorted() && (0.499..0.5).contains(all.time_s.last().unwrap()));
    }
    // A head comes around again, and prisms do not.
    let again = |name: &str| {
        let all = sensor(name).with_revolutions(five).unwrap().pattern();
        let one = sensor(name).pattern().len();
        all.directions[one].distance(all.directions[0])
    };
    assert!(again("os1-128") < 1e-9 && again("avia") > 0.1);
    for name in ["os1-128", "avia"] {
        let too_many = sensor(name).with_revolutions(NonZeroU32::MAX).unwrap_err();
        assert!(too_many.to_string().contains("revolutions: expected at most 67108864 rays"));
    }
    let alike = sensor("generic-static").with_revolutions(five).unwrap_err().to_string();
    assert!(alike.contains("revolutions: expected 1, as all scans of [uniform] and [grid]"));
}

/// Livox states 70.4 degrees of both; the rosette of an Avia is higher than wide.
#[test]
fn rosettes_fill_the_fields_of_view_that_their_maker_states() {
    let thirty = NonZeroU32::new(30).unwrap();
    for (name, width_deg, height_deg) in [("avia", 70.4, 77.2), ("mid70", 70.4, 70.4)] {
        let pattern = sensor(name).with_revolutions(thirty).unwrap().pattern();
        let spread = |of: fn(&DVec3) -> f64| {
            let angles = pattern.directions.iter().map(|d| of(d).to_degrees());
            let ends = angles.fold([90.0f64, -90.0], |[a, b], x| [a.min(x), b.max(x)]);
            ends[1] - ends[0]
        };
        let (wide, high) = (spread(|d| d.y.atan2(d.x)), spread(|d| d.z.asin()));
        assert!((wide - width_deg).abs() < 0.05 * width_deg, "{name}: {wide} wide");
        assert!((high - height_deg).abs() < 0.05 * height_deg, "{name}: {high} high");
    }
}

const TABLE: &str = r#"
name = "own"
range = { max_m = 10 }
[table]
pulse_hz = 40
period_s = 0.1
lines = 2
"#;

#[test]
fn a_table_is_fired_row_by_row_again_and_again() {
    let folder = tempfile::tempdir().unwrap();
    let in_folder = |name: &str| folder.path().join(name);
    // Livox's columns: the first is a row's number, and zenith 90 is the horizon.
    let csv =
        "Time/s,Azimuth/deg,Zenith/deg\n1,0,90\n2,90,45\n3,180,90\n4,270,120\n5,30,90\n6,60,90\n";
    std::fs::write(in_folder("rows.csv"), csv).unwrap();
    std::fs::write(in_folder("own.toml"), TABLE.to_owned() + "file = \"rows.csv\"\n").unwrap();
    let own = SensorProfile::load(&in_folder("own.toml")).unwrap();
    let pattern = own.pattern();
    assert_eq!(pattern.ring, [0, 1, 0, 1]);
    for (ray, (elevation_deg, azimuth_deg)) in
        [(0.0, 0.0), (45.0, 90.0), (0.0, 180.0), (-30.0, 270.0)].into_iter().enumerate()
    {
        assert_near(pattern.directions[ray], at(elevation_deg, azimuth_deg));
        assert_eq!(pattern.time_s[ray], ray as f64 / 40.0);
    }
    let twice = own.clone().with_revolutions(NonZeroU32::new(2).unwrap()).unwrap().pattern();
    assert_near(twice.directions[4], at(0.0, 30.0));
    assert_eq!(twice.directions[6], pattern.directions[0]);
    // Unused rows are dropped, and the scan is the same.
    let trimmed = own.clone().trimmed();
    assert!(matches!(&trimmed.layout, Layout::Table(table) if table.directions_deg.len() == 4));
    assert_eq!(trimmed.pattern(), pattern);
    let json = serde_json::to_string(&trimmed).unwrap();
    assert_eq!(serde_json::from_str::<SensorProfile>(&json).unwrap(), trimmed);
}

#[test]
fn a_table_that_cannot_be_used_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let profile = folder.path().join("own.toml");
    std::fs::write(&profile, TABLE.to_owned() + "file = \"rows.csv\"\n").unwrap();
    for row in include_str!("bad_tables.txt").lines() {
        let (rows, expected) = row.split_once(" -> ").unwrap();
        std::fs::write(folder.path().join("rows.csv"), rows.replace("\\n", "\n")).unwrap();
        let error = SensorProfile::load(&profile).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    std::fs::remove_file(folder.path().join("rows.csv")).unwrap();
    let error = SensorProfile::load(&profile).unwrap_err().to_string();
    assert!(error.contains("rows.csv: No such file"), "{error}");
}
