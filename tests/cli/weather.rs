//! `corrupt --rain`; weather, wide beams and motion in scenes, datasets and drives.

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
    let said = folder.succeeds("corrupt clear.npz --rain 50 --out rain.npz");
    for part in ["kept ", "rain ", "lost ", "points: "] {
        assert!(said.contains(part), "{said}");
    }
    let rainy = folder.scan("rain.npz");
    let n_drops = rainy.medium.as_ref().unwrap().iter().filter(|&&medium| medium == 1).count();
    assert!(n_drops > 50 && n_drops < clear.len() / 5, "{n_drops} of {}", clear.len());
    assert_eq!(rainy.ring.as_ref().unwrap().len(), rainy.len());
    folder.succeeds("corrupt clear.npz --fog 60 --haze 2000 --snow 1 --out fog.ply --seed 4");
    assert!(folder.scan("fog.ply").medium.unwrap().contains(&3));
    // Of each format, the same points with the same intensities.
    for name in ["clear.pcd", "clear.csv"] {
        folder.succeeds(&format!("scan clear.toml --adapter cpu --out {name}"));
        let said =
            folder.succeeds(&format!("corrupt {name} --rain 50 --out again.npz --overwrite"));
        assert!(said.contains(&format!("{} points", rainy.len())), "{said}");
        assert_eq!(folder.scan("again.npz").intensity, rainy.intensity, "{name}");
    }
    folder.write("cloud.xyz", "5 0 0\n9 1 0\nnan nan nan\n0 0 0\n");
    let said = folder.succeeds("corrupt cloud.xyz --reflectivity 0.5 --rain 1 --out cloud.csv");
    assert!(said.contains("no point") && said.contains("4 points"), "{said}");
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
    let words = "gen-dataset meshes --adapter cpu --sensor vlp32c --views 2";
    folder.succeeds(&format!("{words} --out one --effects effects.toml"));
    folder.succeeds(&format!("{words} --out none"));
    folder.succeeds("gen-dataset --verify one");
    let scans = tests::tree::files(&folder.at("none/rotational/clean"));
    let differ = scans.iter().filter(|(path, content)| {
        let moved = std::fs::read(folder.at("one/rotational/clean").join(path)).unwrap();
        moved != **content
    });
    assert_eq!(differ.count(), scans.len(), "all views are seen while the sensor moves");
}
