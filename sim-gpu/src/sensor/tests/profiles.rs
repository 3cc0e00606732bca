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

/// Each row of the file replaces the first text by the second in a sound profile; the error must hold
/// the third. A paragraph is of one profile.
#[test]
fn bad_profiles_are_named() {
    let crossing = &TINY.replace("rpm = 60", "rpm = 60\nbeam_crossing_m = 0.04");
    let [uniform, grid] = [1, 2].map(|nth| SENSORS[nth].1);
    let paragraphs = include_str!("bad_profiles.txt").split("\n\n");
    for (profile, rows) in [TINY, crossing, uniform, grid].into_iter().zip(paragraphs) {
        for row in rows.lines() {
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
