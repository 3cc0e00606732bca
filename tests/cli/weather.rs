//! `weather`; weather, wide beams and motion in scenes, datasets and drives.

use crate::Folder;

const WALL: &str = "OFF\n4 1 0\n20 -30 -10\n20 30 -10\n20 30 10\n20 -30 10\n4 0 3 2 1\n";

fn scene(effects: &str) -> String {
    format!(
        "seed = 3\nattributes = [\"range\", \"beam\", \"ring\", \"medium\", \"return\"]\n\
         [effects]\n{effects}\n[[object]]\nmesh = \"wall.off\"\nreflectivity = 0.3\n\
         [[sensor]]\nprofile = \"vlp32c\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n"
    )
}

#[test]
fn a_recorded_scan_is_weathered_and_each_of_its_points_labelled() {
    let folder = Folder::new();
    folder.write("wall.off", WALL);
    folder.write("clear.toml", scene("detection = true\nintensity = true"));
    let text = folder.text("clear.toml").replace("\"return\"]", "\"intensity\"]");
    folder.write("clear.toml", text);
    folder.succeeds("scan clear.toml --adapter cpu --out clear.npz");
    let clear = folder.scan("clear.npz");
    for out in ["rain.npz", "again.npz"] {
        let said = folder.succeeds(&format!("weather clear.npz --rain 50 --out {out}"));
        for part in ["kept ", "rain ", "lost ", "points: "] {
            assert!(said.contains(part), "{said}");
        }
    }
    assert!(folder.bytes("rain.npz") == folder.bytes("again.npz"), "the same seed");
    let rainy = folder.scan("rain.npz");
    let n_drops = rainy.medium.as_ref().unwrap().iter().filter(|&&medium| medium == 1).count();
    assert!(n_drops > 50 && n_drops < clear.len() / 5, "{n_drops} of {}", clear.len());
    assert_eq!(rainy.ring.as_ref().unwrap().len(), rainy.len());
    folder.succeeds("weather clear.npz --fog 60 --haze 2000 --snow 1 --out fog.ply --seed 4");
    assert!(folder.scan("fog.ply").medium.unwrap().contains(&3));
    // Of each format, the same points with the same intensities.
    for name in ["clear.pcd", "clear.csv"] {
        folder.succeeds(&format!("scan clear.toml --adapter cpu --out {name}"));
        let said =
            folder.succeeds(&format!("weather {name} --rain 50 --out again.npz --overwrite"));
        assert!(said.contains(&format!("{} points", rainy.len())), "{said}");
        assert_eq!(folder.scan("again.npz").intensity, rainy.intensity, "{name}");
    }
    folder.write("cloud.xyz", "5 0 0\n9 1 0\nnan nan nan\n0 0 0\n");
    let said = folder.succeeds("weather cloud.xyz --reflectivity 0.5 --rain 1 --out cloud.csv");
    assert!(said.contains("no point") && said.contains("4 points"), "{said}");
}

#[test]
fn effects_work_in_scenes_datasets_and_drives() {
    const ALL: &str = "footprint = true\nreturns = \"dual\"\nweather = { rain_mm_h = 50, \
                       fog_visibility_m = 150 }\nnoise = { sigma_m = 0.01 }";
    let folder = Folder::with_meshes();
    folder.write("wall.off", WALL);
    folder.write("scene.toml", scene(ALL));
    let said = folder.succeeds("scan scene.toml --adapter cpu --out scan.npz");
    assert!(said.contains(" of the air") && said.contains("undetected"), "{said}");
    let scan = folder.scan("scan.npz");
    let numbers = scan.return_number.as_ref().unwrap();
    assert!(numbers.contains(&1) && numbers.contains(&2));
    folder.succeeds("scan scene.toml --adapter cpu --out scan.pcap");

    folder.write("effects.toml", format!("[effects]\n{ALL}\n"));
    for out in ["one", "other"] {
        folder.succeeds(&format!(
            "gen-dataset meshes --out {out} --adapter cpu --sensor vlp32c --views 1 --effects \
             effects.toml --attributes medium,return --format npz,pcap --min-points 1"
        ));
    }
    folder.assert_same_tree("one/rotational", "other/rotational");
    folder.succeeds("gen-dataset --verify one");

    // A recipe's sensors state their own noise.
    let (effects, _) = ALL.rsplit_once('\n').unwrap();
    let effects = effects.replace('\n', ", ");
    folder.write(
        "drive.toml",
        format!(
            "variants = 1\n[ground]\nroad_width_m = [8, 8]\n[mount]\nheight_m = [1.5, 1.5]\n\
             [[sensor]]\nprofile = \"vlp32c\"\neffects = {{ {effects} }}\n\
             [[object]]\nkind = \"car\"\nclass = \"car\"\ncount = [4, 4]\nplace = \"parked\"\n\
             distance_m = [4, 30]\n"
        ),
    );
    folder.succeeds("gen-drive drive.toml --seconds 0.2 --out drive.pcap");
    folder.succeeds("gen-scenes drive.toml --adapter cpu --sweeps 2 --save 1 --out scenes");
}

#[test]
fn what_cannot_be_weathered_is_refused() {
    let folder = Folder::new();
    folder.write("cloud.xyz", "5 0 0\n9 1 0\n");
    folder.write("cloud.csv", "x,y,z,Intensity\n5,0,0,255\n");
    folder.write("dark.toml", DARK);
    folder.write("bright.bin", [5f32, 0.0, 0.0, 200.0].map(f32::to_le_bytes).concat());
    folder.write("black.bin", [5f32, 0.0, 0.0, -1.0].map(f32::to_le_bytes).concat());
    folder.refuses(
        2,
        &[
            ("weather cloud.xyz --out a.npz", "expected one of --rain, --snow, --fog and --haze"),
            ("weather cloud.xyz --rain 0 --out a.npz", "--fog and --haze, above 0"),
            ("weather cloud.xyz --rain 5 --fog-model hahner --out a.npz", "--fog <M>"),
            ("weather cloud.xyz --rain 5 --out a.npz", "have no intensity: give --reflectivity"),
            ("weather cloud.csv --rain 5 --out a.npz", "around 0 to 1, found 255: give --white"),
            (
                "weather cloud.csv --rain 5 --white 65535 --out a.npz",
                "cloud.csv: expected intensities around 0 to 65535 by --white, found 255 at most",
            ),
            ("weather cloud.xyz --rain -1 --out a.npz", "--rain: expected a number within"),
            ("weather cloud.xyz --rain nan --out a.npz", "--rain: expected a number within"),
            ("weather cloud.xyz --fog 0 --out a.npz", "--fog: expected a number within"),
            (
                "weather cloud.xyz --rain 5 --reflectivity 2 --out a.npz",
                "--reflectivity <R>': expected",
            ),
            ("weather cloud.xyz --rain 5 --out a.pcap", "--out: expected .npz, .ply, .csv or .pcd"),
            ("weather bright.bin --rain 5 --out a.npz", "around 0 to 1, found 200: give --white"),
            (
                "weather cloud.xyz --rain 5 --reflectivity 1 --profile ./dark.toml --out a.npz",
                "sensor \"dark\" has no [detection]",
            ),
        ],
    );
    folder.refuses(
        1,
        &[
            ("weather none.npz --rain 5 --out a.npz", "none.npz"),
            ("weather black.bin --rain 5 --out a.npz", "point 0: expected an intensity of 0 or"),
        ],
    );
    assert!(!folder.at("a.npz").exists() && !folder.at("a.pcap").exists());
    // Black surfaces return nothing, and haze scatters nothing back.
    let said = folder.exits(3, "weather cloud.xyz --haze 1000 --reflectivity 0 --out a.npz");
    assert!(said.contains("0 points: a.npz") && said.contains("no point is left"), "{said}");
}

/// A sensor that states no detection limit.
const DARK: &str = "name = \"dark\"\nrange = { max_m = 50.0 }\n[uniform]\nazimuth_from_deg = 0.0\n\
                    azimuth_to_deg = 9.0\nazimuth_steps = 9\nelevation_from_deg = 0.0\n\
                    elevation_to_deg = 9.0\nelevation_steps = 9\nrpm = 600.0\n";

#[test]
fn effects_that_contradict_or_overreach_are_refused() {
    let folder = Folder::new();
    folder.write("wall.off", WALL);
    folder.write("dark.toml", DARK);
    for (effects, part) in [
        ("footprint = { samples = 5 }", "samples: expected 1, 7, 19 or 37, found 5"),
        ("footprint = { divergence_deg = [91, 0] }", "divergence_deg[0]: expected a number within"),
        ("footprint = { width = 1 }", "footprint"),
        ("returns = \"both\"", "returns"),
        ("weather = { rain_mm_h = 2e6 }", "rain_mm_h: expected a number within"),
        ("weather = { fog_visibility_m = 0 }", "fog_visibility_m: expected a number within"),
        ("weather = { hail_mm_h = 1 }", "hail_mm_h"),
        (
            "weather = { volumes = [{ min_m = [1, 0, 0], max_m = [0, 0, 0], visibility_m = 1 }] }",
            "volumes[0].max_m[0]: expected a number within",
        ),
    ] {
        folder.write("scene.toml", scene(effects));
        let said = folder.exits(1, "scan scene.toml --adapter cpu --out a.npz");
        assert!(said.contains(part) && said.contains("scene.toml"), "{effects}: {said}");
    }
    for (effects, part) in [
        ("footprint = true", "footprint.divergence_deg: expected a value, as sensor \"dark\""),
        ("weather = { rain_mm_h = 1 }", "expected reflectivity and range_m, as sensor \"dark\""),
    ] {
        folder.write("scene.toml", scene(effects).replace("vlp32c", "./dark.toml"));
        let said = folder.exits(1, "scan scene.toml --adapter cpu --out a.npz");
        assert!(said.contains(part), "{effects}: {said}");
    }
    folder.write("scene.toml", scene("returns = \"first\""));
    let said = folder.exits(1, "scan scene.toml --adapter cpu --out a.pcap");
    assert!(said.contains("effects.returns: \"first\" is not among theirs"), "{said}");
    assert!(!folder.at("a.npz").exists() && !folder.at("a.pcap").exists());
}

#[test]
fn sensors_and_objects_of_a_scene_move_along_trajectories() {
    let folder = Folder::new();
    folder.write("wall.off", WALL);
    folder.write("ego.tum", "# t p q\n100 0 0 0 0 0 0 1\n101 10 0 0 0 0 0 1\n");
    // The wall comes 1 m nearer in a tenth of a second.
    folder.write("car.tum", "100 0 0 0 0 0 0 1\n100.1 -1 0 0 0 0 0 1\n");
    let moves = |sensor: &str| {
        scene("quantise_m = true")
            .replace("\"return\"]", "\"sensor\", \"attitude\"]")
            .replace("position_m = [0, 0, 0]\nyaw_deg = 0\n", sensor)
            .replace("reflectivity", "trajectory = \"car.tum\"\nreflectivity")
    };
    for (name, deskew) in [("raw", false), ("deskewed", true)] {
        let sensor = format!("trajectory = \"ego.tum\"\nstart_s = 100.0\ndeskew = {deskew}\n");
        folder.write(&format!("{name}.toml"), moves(&sensor));
        folder.succeeds(&format!("scan {name}.toml --adapter cpu --out {name}.npz"));
    }
    let [raw, deskewed] = ["raw.npz", "deskewed.npz"].map(|file| folder.scan(file));
    assert_eq!(raw.range_m, deskewed.range_m);
    assert!(raw.positions != deskewed.positions && raw.len() > 1000);
    // In a tenth of a second, the sensor moves 1 m.
    let farthest = deskewed.sensor_m.unwrap().iter().fold(0f32, |far, at| far.max(at[0]));
    assert!((0.9..1.0).contains(&farthest), "{farthest} m");
    let [nearest, farthest] = [f32::min, f32::max]
        .map(|ends| deskewed.positions.iter().map(|at| at[0]).reduce(ends).unwrap());
    assert!(nearest < 19.1 && farthest > 19.9, "the wall comes from 20 m: {nearest} {farthest}");
    // KITTI's lines have no times: the first is at 0.
    folder.write("car.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 -1 0 1 0 0 0 0 1 0\n");
    let early = moves("trajectory = \"ego.tum\"\nstart_s = 100\n").replace("car.tum", "car.txt");
    folder.write("early.toml", early);
    let said = folder.exits(1, "scan early.toml --adapter cpu --out bad.npz");
    assert!(said.contains("object[0].trajectory: expected poses around 100 s"), "{said}");
    for (sensor, part) in [
        ("trajectory = \"none.tum\"\n", "sensor[0].trajectory: "),
        ("trajectory = \"ego.tum\"\n", "sensor[0].trajectory: expected poses from 0 s"),
        ("trajectory = \"wall.off\"\n", "wall.off: line 1: expected a number, found \"OFF\""),
        ("trajectory = \"ego.tum\"\nposition_m = [0, 0, 0]\n", "cannot stand beside position_m"),
        ("trajectory = \"ego.tum\"\nstart_s = inf\n", "start_s: expected a number within"),
        ("yaw_deg = 3\n", "expected position_m or trajectory, found neither"),
        (
            "trajectory = \"ego.tum\"\nstart_s = 100\n#ringed",
            "sensor[0].trajectory: cannot move a sensor whose profile has [rings]",
        ),
    ] {
        let ringed = if sensor.contains("ringed") { "modelnet40c-lidar" } else { "vlp32c" };
        let text = moves(sensor).replace("\"vlp32c\"", &format!("\"{ringed}\""));
        folder.write("bad.toml", text.replace("quantise_m = true", ""));
        let said = folder.exits(1, "scan bad.toml --adapter cpu --out bad.npz");
        assert!(said.contains(part) && said.contains("bad.toml"), "{sensor}: {said}");
    }
    assert!(!folder.at("bad.npz").exists());
}

#[test]
fn a_sensor_moves_evenly_where_its_effects_say_so() {
    let folder = Folder::with_meshes();
    folder.write("wall.off", WALL);
    let motion = "motion = { velocity_m_s = [10, 0, 0], yaw_rate_deg_s = 30 }";
    let attributes = |text: String| text.replace("\"return\"]", "\"time\"]");
    folder.write("moves.toml", attributes(scene(motion)));
    folder.write("rests.toml", attributes(scene("")));
    for name in ["moves", "rests"] {
        folder.succeeds(&format!("scan {name}.toml --adapter cpu --out {name}.npz"));
    }
    let ranges = |name: &str| {
        let scan = folder.scan(name);
        let beams = scan.beam.unwrap().into_iter();
        let seen = scan.range_m.unwrap().into_iter().zip(scan.time_s.unwrap());
        beams.zip(seen).collect::<std::collections::BTreeMap<_, _>>()
    };
    let (moves, rests) = (ranges("moves.npz"), ranges("rests.npz"));
    // The wall ahead comes nearer at 10 m/s. The first and the last beams point forward.
    let ahead = rests.iter().filter(|(_, (range_m, _))| (20.0..20.1).contains(range_m));
    let mut n = 0;
    for (beam, (range_m, time_s)) in ahead {
        let Some((found_m, _)) = moves.get(beam) else { continue };
        let off_m = f64::from(range_m - found_m) - 10.0 * f64::from(*time_s);
        // The rotation of 3 degrees lengthens the range by 1 / cos, 0.03 m.
        assert!(off_m.abs() < 0.2, "beam {beam} at {time_s} s: {off_m}");
        n += 1;
    }
    assert!(n > 50, "{n}");

    folder.write("effects.toml", "[effects]\nmotion = { velocity_m_s = [0, 20, 0] }\n");
    for (out, flags) in
        [("one", "--effects effects.toml"), ("two", "--effects effects.toml"), ("none", "")]
    {
        folder.succeeds(&format!(
            "gen-dataset meshes --out {out} --adapter cpu --sensor vlp32c --views 2 {flags}"
        ));
    }
    folder.assert_same_tree("one/rotational", "two/rotational");
    folder.succeeds("gen-dataset --verify one");
    let scans = tests::tree::files(&folder.at("none/rotational/clean"));
    let differ = scans.iter().filter(|(path, content)| {
        let moved = std::fs::read(folder.at("one/rotational/clean").join(path)).unwrap();
        moved != **content
    });
    assert_eq!(differ.count(), scans.len(), "all views are seen while the sensor moves");
    folder.write("fast.toml", "[effects]\nmotion = { velocity_m_s = [0, 1e4, 0] }\n");
    folder.write(
        "street.toml",
        "object = [{ kind = \"car\", class = \"car\", count = [1, 1], place = \"road\", \
         distance_m = [3, 9] }]\nmount = { height_m = [1, 1] }\nsensor = [{ profile = \"vlp32c\", \
         effects = { motion = { yaw_rate_deg_s = 9 } } }]\n",
    );
    folder.refuses(
        1,
        &[(
            "gen-drive street.toml --out a.pcap",
            "effects.motion: expected no motion, because a drive moves the sensor itself",
        )],
    );
    let said =
        folder.edgepuck("gen-dataset meshes --out bad --effects fast.toml").output().unwrap();
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(said.contains("effects.motion.velocity_m_s[1]: expected a number within"), "{said}");
}
