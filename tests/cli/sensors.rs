//! `profile`, and scans by sensors that are not rotating heads.

use crate::Folder;

const METADATA: &str = r#"{
  "beam_altitude_angles": [10.0, -10.0], "beam_azimuth_angles": [3.0, -3.0],
  "lidar_origin_to_beam_origin_mm": 15.8, "lidar_mode": "512x10",
  "lidar_to_sensor_transform": [-1,0,0,0, 0,-1,0,0, 0,0,1,36.18, 0,0,0,1],
  "data_format": {"pixels_per_column": 2, "columns_per_frame": 512, "columns_per_packet": 16}
}"#;

#[test]
fn profile_lists_the_sensors_and_describes_each() {
    let folder = Folder::new();
    let list = folder.succeeds("profile");
    for name in ["vlp32c ", "os1-128 ", "avia ", "xt32 ", "helios-5515 ", "rplidar-a1 "] {
        let said = folder.succeeds(&format!("profile {name}"));
        assert!(list.contains(name) && said.contains("elevations"), "{name}: {said}");
        assert!(!said.contains("warning"), "{name}: {said}");
    }
    folder.succeeds("profile avia --beams beams.csv");
    let beams = folder.text("beams.csv");
    assert_eq!(beams.lines().count(), 24_001);
    assert!(beams.starts_with("time_s,ring,azimuth_deg,elevation_deg,x_m,y_m,z_m\n0,0,"));
}

#[test]
fn a_profile_is_checked_and_what_looks_odd_of_it_is_said() {
    let folder = Folder::new();
    let profiles = [
        // Elevations in radians, a duplicate beam, and a limit that no surface reaches.
        (
            "odd.toml",
            "name = \"odd\"\nrange = { max_m = 100 }\ndetection = { reflectivity = 1, range_m = 50 }\n\
         [rotating]\nrpm = 600\nsequence_us = 50\nbeam = [\n\
         { azimuth_offset_deg = 0, elevation_deg = 0.1, firing_us = 0 },\n\
         { azimuth_offset_deg = 0, elevation_deg = -0.2, firing_us = 0 },\n\
         { azimuth_offset_deg = 0, elevation_deg = 0.1, firing_us = 5 }]\n",
            &[
                "are they in radians?",
                "even a white surface is lost beyond 50.0 m",
                "rotating.beam[2] points as rotating.beam[0] does",
            ][..],
        ),
        // Millimetres, revolutions a second, nanoseconds and milliradians.
        (
            "units.toml",
            "name = \"units\"\nrange = { min_m = 500, max_m = 50000, quantum_m = 4 }\n\
         noise = { typical_sigma_m = 30 }\nfootprint = { divergence_deg = [3, 1.5], separation_m = 1 }\n\
         [rotating]\nrpm = 10\nsequence_us = 1000000\nbeam = [\n\
         { azimuth_offset_deg = 0, elevation_deg = 10, firing_us = 0 }]\n",
            &[
                "range.min_m = 500: is it in metres?",
                "range.max_m = 50000: is it in metres?",
                "range.quantum_m = 4: is it in metres?",
                "noise.typical_sigma_m = 30: is it in metres?",
                "footprint.divergence_deg = 3: is it in degrees?",
                "rotating.rpm = 10: is it in revolutions a minute?",
                "rotating.sequence_us = 1000000: is it in microseconds?",
                "a scan has only 6 rays",
            ],
        ),
        (
            "camera.toml",
            "name = \"camera\"\nrange = { min_m = 0.5, max_m = 5 }\n\
         [grid]\nwidth = 640\nheight = 480\nfx = 500\nfy = 500\ncx = 5000\ncy = 239.5\n",
            &["grid.cx = 5000: the picture has pixels from 0 to 639"],
        ),
    ];
    for (file, text, parts) in profiles {
        folder.write(file, text);
        let said = folder.succeeds(&format!("profile {file}"));
        for part in parts {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
    folder.write(
        "wrong.toml",
        folder.text("odd.toml").replace("sequence_us = 50", "sequence_us = 1"),
    );
    folder.write("rows.csv", "azimuth_deg;elevation_deg\n1;2\n");
    folder.write("cut.json", METADATA.replace("10.0, -10.0", "10.0"));
    folder.refuses(
        1,
        &[
            ("profile wrong.toml", "rotating.beam[2].firing_us: expected a number"),
            (
                "profile cut.json",
                "error: cut.json: beam_altitude_angles: expected 2 values, found 1",
            ),
            ("profile rows.csv", "rows.csv: table.file: expected a profile in TOML, which names a"),
            ("profile nowhere.toml", "nowhere.toml: No such file"),
            ("profile os5", "one of the sensors vlp32c"),
        ],
    );
    folder.refuses(2, &[("profile vlp16 --beams beams.txt", "expected a name with .csv")]);
}

#[test]
fn an_ouster_s_own_metadata_are_a_profile() {
    let folder = Folder::with_meshes();
    folder.write("unit.json", METADATA);
    let said = folder.succeeds("profile unit.json --beams beams.csv");
    assert!(said.contains("rays of a scan     1024"), "{said}");
    let beams = folder.text("beams.csv");
    // The head points forward; the first beam 3 degrees clockwise of it.
    let first = beams.lines().nth(1).unwrap();
    assert!(first.starts_with("0,1,-3") || first.starts_with("0,1,-2.99999"), "{first}");
    assert!(first.contains(",0.0158,"), "{first}");
    folder.succeeds(
        "gen-dataset meshes --out out --adapter cpu --sensor unit.json --views 1 --min-points 16",
    );
    folder.succeeds("gen-dataset --verify out");
}

#[test]
fn rosettes_tables_and_many_revolutions_make_scenes_and_datasets() {
    let folder = Folder::with_meshes();
    folder.write("wall.off", "OFF\n4 1 0\n5 -30 -10\n5 30 -10\n5 30 10\n5 -30 10\n4 0 3 2 1\n");
    let scene = |sensor: &str| {
        format!(
            "attributes = [\"time\", \"ring\"]\n[[object]]\nmesh = \"wall.off\"\n[[sensor]]\n{sensor}\n"
        )
    };
    let n_points = |sensor: &str| {
        folder.write("scene.toml", scene(sensor));
        folder.succeeds("scan scene.toml --adapter cpu --overwrite --out scan.npz");
        folder.scan("scan.npz").len()
    };
    let avia = "profile = \"avia\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n";
    let one = n_points(avia);
    let three = n_points(&format!("{avia}revolutions = 3\n"));
    assert!(one == 24_000 && three == 72_000, "{one} {three}");
    let times = folder.scan("scan.npz").time_s.unwrap();
    assert!(times.iter().any(|&time_s| time_s > 0.29), "the scan goes on");

    // Poses in the scene itself: it goes 10 m/s towards the wall.
    let poses = "trajectory = [{ time_s = 0, position_m = [0, 0, 0], yaw_deg = 0 }, \
                 { time_s = 1, position_m = [10, 0, 0], yaw_deg = 0 }]\n";
    n_points(&format!("profile = \"ld19\"\n{poses}deskew = true\n"));
    assert!(folder.scan("scan.npz").positions.iter().all(|p| (p[0] - 5.0).abs() < 1e-5));

    folder.write("rows.csv", "azimuth_deg,elevation_deg\n0,0\n2,1\n-2,-1\n");
    folder.write(
        "own.toml",
        "name = \"own\"\nrange = { max_m = 10 }\n\
         [table]\nfile = \"rows.csv\"\npulse_hz = 1000\nperiod_s = 0.1\n",
    );
    assert_eq!(n_points("profile = \"own.toml\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n"), 100);
    folder.succeeds("gen-dataset meshes --out out --adapter cpu --sensor avia --views 1");
    folder.succeeds("gen-dataset --verify out");
    folder.write(
        "twice.toml",
        scene("profile = \"kinect-v2\"\nposition_m = [0,0,0]\nrevolutions = 2"),
    );
    folder.write(
        "early.toml",
        scene(&format!("profile = \"ld19\"\n{}", poses.replace("= 1,", "= 0,"))),
    );
    folder.refuses(
        1,
        &[
            ("scan twice.toml --out a.npz", "sensor[0].revolutions: expected 1, as all scans of"),
            ("scan early.toml --out a.npz", "sensor[0].trajectory: trajectory[1]: expected a time"),
        ],
    );
}

#[test]
fn scans_of_other_times_have_other_noise() {
    let folder = Folder::new();
    folder.write("wall.off", "OFF\n4 1 0\n5 -30 -10\n5 30 -10\n5 30 10\n5 -30 10\n4 0 3 2 1\n");
    let scan = |start: &str| {
        folder.write(
            "scene.toml",
            format!(
                "[effects]\nnoise = {{ sigma_m = 0.05 }}\n[[object]]\nmesh = \"wall.off\"\n\
                 [[sensor]]\nprofile = \"ld19\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n{start}\n"
            ),
        );
        folder.succeeds("scan scene.toml --adapter cpu --overwrite --out scan.npz");
        folder.scan("scan.npz").positions
    };
    let first = scan("");
    assert_eq!(scan("start_s = 0"), first);
    let later = scan("start_s = 0.1");
    let n_same = first.iter().zip(&later).filter(|(a, b)| a == b).count();
    assert!(first.len() > 100 && n_same == 0, "{n_same} of {}", first.len());
}
