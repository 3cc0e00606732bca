use super::*;

#[test]
fn every_builtin_profile_is_sound_named_and_sourced() {
    for (name, text) in SENSORS {
        let sensor = parse(text).unwrap();
        assert_eq!(sensor.name, name);
        assert!(!sensor.description.is_empty() && !sensor.sources.is_empty(), "{name}");
        assert_eq!(SensorProfile::builtin(name), Some(sensor));
    }
}

#[test]
fn every_sensor_survives_a_round_trip_through_json() {
    for name in builtin_names() {
        let json = serde_json::to_string(&sensor(name)).unwrap();
        assert_eq!(serde_json::from_str::<SensorProfile>(&json).unwrap(), sensor(name), "{json}");
    }
}

#[test]
fn a_name_a_path_and_neither() {
    assert_eq!(SensorProfile::resolve("vlp16").unwrap().name, "vlp16");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    std::fs::write(&file, TINY).unwrap();
    assert_eq!(SensorProfile::resolve(file.to_str().unwrap()).unwrap().name, "tiny");
    assert_eq!(SensorProfile::resolve_in(folder.path(), "own.toml").unwrap().name, "tiny");
    let unknown = SensorProfile::resolve("vlp33").unwrap_err().to_string();
    assert!(unknown.contains("vlp33") && unknown.contains("blainder-ultrapuck"), "{unknown}");
    let missing = SensorProfile::resolve("no/such.toml").unwrap_err().to_string();
    assert!(missing.contains("no/such.toml"), "{missing}");
    let folder_error = SensorProfile::load(folder.path()).unwrap_err().to_string();
    assert!(folder_error.contains(folder.path().to_str().unwrap()), "{folder_error}");
}

#[test]
fn a_file_too_long_or_not_text_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mesh.toml");
    std::fs::write(&file, vec![b' '; (16 << 20) + 1]).unwrap();
    assert!(matches!(SensorProfile::load(&file), Err(ConfigError::TooLong { .. })));
    std::fs::write(&file, [0xff, 0xfe]).unwrap();
    assert!(matches!(SensorProfile::load(&file), Err(ConfigError::Read { .. })));
}

/// Each row replaces the first text by the second in a sound profile; the error must hold the
/// third.
#[test]
fn bad_profiles_are_named() {
    let crossing = &TINY.replace("rpm = 60", "rpm = 60\nbeam_crossing_m = 0.04");
    let [uniform, grid, recipe] = [1, 2, 6].map(|nth| SENSORS[nth].1);
    for (profile, rows) in [
        (TINY, BAD_TINY),
        (crossing, BAD_CROSSING),
        (uniform, BAD_UNIFORM),
        (grid, BAD_GRID),
        (recipe, BAD_RECIPE),
    ] {
        for row in rows.trim().lines() {
            let [from, to, part] = row.split(" -> ").collect::<Vec<_>>()[..] else {
                panic!("{row}")
            };
            assert!(profile.contains(from), "{from} is in no profile");
            let bad = profile.replacen(from, &to.replace("\\n", "\n"), 1);
            let error = parse(&bad).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("my_sensor.toml"), "{to}: {error}");
        }
    }
    let error = parse("name = \"a\"\nrange = { max_m = 1 }").unwrap_err().to_string();
    assert!(
        error.contains(
            "expected one of [rotating], [uniform], [grid], [risley] and [table], found none"
        ),
        "{error}"
    );
    let no_beam = "name = \"a\"\nrange = { max_m = 1 }\n\
                   rotating = { rpm = 60, sequence_us = 9, beam = [] }";
    let error = parse(no_beam).unwrap_err().to_string();
    assert!(error.contains("rotating.beam: expected 1 to 65535 beams, found 0"), "{error}");
}

const BAD_TINY: &str = r#"
name = "tiny" -> name = "" -> name: expected a name
name = "tiny" ->  -> name
name = -> nam = -> nam
max_m = 10 -> max_m = 0 -> range.max_m: expected a number above 0, found 0
max_m = 10 -> max_m = nan -> range.max_m
max_m = 10 -> max_m = inf -> range.max_m
max_m = 10 -> max_m = 1e10 -> range.max_m
max_m = 10 -> min_m = 10, max_m = 10 -> range.max_m: expected a number above range.min_m
max_m = 10 -> min_m = -1, max_m = 10 -> range.min_m
max_m = 10 -> max_m = 10, quantum_m = 0 -> range.quantum_m
max_m = 10 -> max_m = "far" -> line 3: range.max_m: expected a number, found "far"
[rotating] -> [noise]\ntypical_sigma_m = -1\n[rotating] -> noise.typical_sigma_m
rpm = 60 -> rmp = 60 -> found "rmp"; did you mean "rpm"?
rpm = 60 -> rpm = 0 -> rotating.rpm
rpm = 60 -> rpm = 1e300 -> rotating: expected at least one ray
rpm = 60 -> rpm = 1e-300 -> expected at most 67108864 rays
rpm = 60 -> rpm = 60\nazimuth_quantum_deg = -0.01 -> azimuth_quantum_deg
rpm = 60 -> rpm = 60\nsequence_quantum_deg = 0 -> sequence_quantum_deg
rpm = 60 -> rpm = 60\nsequence_quantum_deg = 1\nazimuth_quantum_deg = 1 -> rotating.sequence_quantum_deg: cannot stand beside rotating
rpm = 60 -> rpm = 60\nbeam_crossing_m = -0.1 -> rotating.beam_crossing_m
rpm = 60 -> rpm = 60\nbeam_crossing_m = nan -> rotating.beam_crossing_m
rpm = 60 -> rpm = 60\nbeam_start_m = 2 -> rotating.beam_start_m
rpm = 60 -> rpm = 60\nbeam_start_m = 0.01\nbeam_crossing_m = 0.01 -> rotating.beam_start_m: cannot stand beside rotating.beam_crossing_m
sequence_us = 400_000 -> sequence_us = nan -> rotating.sequence_us
firing_us = 100_000 -> firing_us = 400_000 -> rotating.beam[0].firing_us
firing_us = 0 -> firing_us = -1 -> rotating.beam[1].firing_us
elevation_deg = -5 -> elevation_deg = -91 -> rotating.beam[1].elevation_deg
azimuth_offset_deg = -90 -> azimuth_offset_deg = inf -> beam[1].azimuth_offset
[rotating] -> decimation = 0\n[rotating] -> decimation
[rotating] -> [grid]\nwidth = 1\nheight = 1\n[rotating] -> found several
"#;

const BAD_CROSSING: &str = r#"
elevation_deg = -5 -> elevation_deg = -89.5 -> rotating.beam[1].elevation_deg
[rotating] -> rings = { step_deg = 1, keep_from = 0, keep_to = 1 }\n[rotating] -> rotating.beam_crossing_m: cannot stand beside [rings]
"#;

const BAD_UNIFORM: &str = r#"
azimuth_steps = 1800 -> azimuth_steps = 0 -> expected at least one ray
azimuth_steps = 1800 -> azimuth_steps = 4000000000 -> expected at most 67108864 rays
elevation_steps = 122 -> elevation_steps = 70000 -> uniform.elevation_steps
elevation_to_deg = 20.0 -> elevation_to_deg = 90.1 -> uniform.elevation_to_deg
azimuth_steps = 1800 -> azimuth_steps = -1 -> line
"#;

const BAD_GRID: &str = r#"
fov_x_deg = 60.0 -> fov_x_deg = 180 -> grid.fov_x_deg: expected a number below 180, found 180
fov_x_deg = 60.0 -> fov_x_deg = -60 -> grid.fov_x_deg
fov_x_deg = 60.0 ->  -> grid: expected either
fov_x_deg = 60.0 -> fov_x_deg = 60\nfx = 3 -> grid: expected either
width = 100 -> width = 4294967295 -> expected at most 67108864 rays
height = 100 -> height = 0 -> expected at least one ray
"#;

const BAD_RECIPE: &str = r#"
fx = 365.0 -> fx = 0 -> grid.fx
cy = 359.5 -> cy = nan -> grid.cy
step_deg = 1.0 -> step_deg = 0 -> rings.step_deg
keep_to = 0.75 -> keep_to = 0.25 -> rings.keep_to
points = 768 -> points = 0 -> sample.points
before_rings = 1024 -> before_rings = 0 -> sample.before_rings
count = 5 -> count = 4294967296 -> views.count: expected a whole number within 0..=4294967295
distance_m = 5.0 -> distance_m = 0 -> views.distance_m
normalize = "bbox" -> normalize = "box" -> views.normalize: expected one of
"#;

#[test]
fn the_profiles_of_sensors_md_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let csv = "azimuth_deg,elevation_deg\n".to_owned() + &"1,2\n".repeat(80_000);
    std::fs::write(folder.path().join("mid360.csv"), csv).unwrap();
    let page = include_str!("../../../SENSORS.md");
    let mut snippets = page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next());
    let head = snippets.next().unwrap();
    let n_beams = snippets.map(|layout| {
        let file = folder.path().join("my_sensor.toml");
        std::fs::write(&file, format!("{head}\n{layout}")).unwrap();
        let found = SensorProfile::load(&file);
        let profile = found.unwrap_or_else(|error| panic!("{error}\n{layout}"));
        profile.pattern().len()
    });
    assert_eq!(n_beams.collect::<Vec<_>>(), [4_000, 10_000, 20_000]);
}
