//! `corrupt`: corruptions of sweeps.

use crate::Folder;
use formats::cloud_file::write_cloud;
use std::collections::BTreeMap;

const STREET: &str = "attributes = [\"range\", \"ring\", \"time\", \"intensity\"]\n\
    [effects]\nintensity = true\n\
    [[object]]\nmesh = \"ground.off\"\nreflectivity = 0.2\n\
    [[object]]\nmesh = \"wall.off\"\nreflectivity = 0.6\n\
    [[sensor]]\nprofile = \"vlp32c\"\nposition_m = [0, 0, 1.8]\nyaw_deg = 0\n";
const GROUND: &str = "OFF\n4 1 0\n-50 -50 0\n50 -50 0\n50 50 0\n-50 50 0\n4 0 1 2 3\n";
const WALL: &str = "OFF\n4 1 0\n20 -30 0\n20 30 0\n20 30 6\n20 -30 6\n4 0 3 2 1\n";

/// A folder with a sweep, sweep.npz.
fn with_sweep() -> Folder {
    let folder = Folder::new();
    folder.write("ground.off", GROUND);
    folder.write("wall.off", WALL);
    folder.write("street.toml", STREET);
    folder.succeeds("scan street.toml --adapter cpu --out sweep.npz");
    folder
}

fn counts(folder: &Folder, file: &str) -> BTreeMap<String, usize> {
    let text = folder.text(file);
    let line = |line: &str| {
        let words: Vec<&str> = line.split(',').collect();
        (words[0].to_owned(), words[3].parse().unwrap())
    };
    text.lines().skip(1).map(line).collect()
}

#[test]
fn a_sweep_is_corrupted_in_every_way_and_twice_alike() {
    let folder = with_sweep();
    let sweep = folder.scan("sweep.npz");
    // The file of the scan has the sensor's position.
    folder.succeeds("corrupt sweep.npz --out one");
    folder.succeeds("corrupt sweep.npz --origin 0 0 1.8 --out other");
    folder.assert_same_tree("one", "other");
    let found = counts(&folder, "one/corruptions.csv");
    assert_eq!(found.len(), 24);
    for (file, count) in &found {
        let scan = folder.scan(&format!("one/{file}"));
        assert_eq!(scan.len(), *count, "{file}");
        assert!(scan.positions != sweep.positions || scan.intensity != sweep.intensity, "{file}");
    }
    // Of a camera, y points downwards.
    let camera = sweep.positions.iter().map(|&[x, y, z]| [x, 1.8 - z, y].map(f64::from));
    write_cloud(&folder.at("camera.npy"), &camera.collect::<Vec<_>>()).unwrap();
    let said = folder.succeeds("corrupt camera.npy --reflectivity 0.5 --only wet-ground --out wet");
    assert!(said.contains("camera.npy: ") && said.contains("ground if z points up"), "{said}");
    // A higher severity leaves fewer points.
    for name in ["wet-ground", "beam-missing", "incomplete-echo", "cross-sensor"] {
        let left = |n: u32| found[&format!("{name}-{n}.npz")];
        assert!(sweep.len() >= left(1) && left(1) >= left(2) && left(2) > left(3), "{name}");
    }
    // At 30 m/s, for a tenth of a second.
    let moved = folder.scan("one/motion-blur-3.npz");
    let farthest = sweep.positions.iter().zip(&moved.positions);
    let farthest = farthest.map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
    assert!((2.0..5.0).contains(&farthest), "{farthest}");

    // A file with only points has no rings and no times: corruptions that need them are left out,
    // and reported.
    folder.write("cloud.xyz", "5 0 0\n9 1 0\n0 0 0\nnan nan nan\n");
    let said = folder.succeeds("corrupt cloud.xyz --reflectivity 0.5 --out bare");
    for part in ["motion-blur-1: left out", "no times", "cross-sensor-3: left out", "no rings"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(counts(&folder, "bare/corruptions.csv").len(), 15);
    // Corruptions that do not depend on power need no intensities and no detection limit.
    folder.succeeds("corrupt cloud.xyz --only crosstalk --sensor kinect-v2 --out lightless");
    assert!(folder.scan("lightless/crosstalk-1.npz").intensity.is_none());
}

#[test]
fn sweeps_of_the_default_commands_have_the_intensities_that_corruptions_need() {
    let folder = Folder::new();
    folder.write("wall.off", WALL);
    folder.succeeds("gen-scenes yard --adapter cpu --sweeps 1 --save 1 --out scenes");
    folder.succeeds("scan wall.off --distance 10 --adapter cpu --out wall.ply");
    // The sensor looks at the middle of the wall, from 20 degrees above: white, with the cosine of
    // the incidence. The centre of the wall is at (20, 0, 3).
    let wall = formats::scan_file::read_scan(&folder.at("wall.ply")).unwrap();
    let brightest = wall.intensity.iter().flatten().copied().fold(0.0, f32::max);
    assert!((0.99..=1.0).contains(&brightest), "{brightest}");
    for sweep in ["scenes/sweeps/000000.npz", "wall.ply"] {
        let words = "--only fog,wet-ground,crosstalk --severity 1 --overwrite";
        folder.succeeds(&format!("corrupt {sweep} {words} --out out"));
        for (file, count) in counts(&folder, "out/corruptions.csv") {
            let scan = folder.scan(&format!("out/{file}"));
            assert!(count > 100 && scan.intensity.unwrap().iter().any(|i| *i > 0.1), "{file}");
        }
    }
}

#[test]
fn intensities_stay_in_the_numbers_of_the_file() {
    let folder = with_sweep();
    let mut sweep = folder.scan("sweep.npz");
    sweep.intensity.iter_mut().flatten().for_each(|intensity| *intensity *= 128.0);
    let hashing = formats::hash::Hashing::None;
    let npz = formats::scan_file::ScanFormat::Npz;
    formats::scan_file::write_scan(&folder.at("bytes.npz"), npz, hashing, &sweep).unwrap();
    folder.succeeds("corrupt bytes.npz --origin 0 0 1.8 --white 128 --out out --severity 1");
    let most = |scan: &formats::Scan| scan.intensity.iter().flatten().copied().fold(0.0, f32::max);
    for (file, _) in counts(&folder, "out/corruptions.csv") {
        let found = most(&folder.scan(&format!("out/{file}")));
        let expected = match file.as_str() {
            "fog-1.npz" | "snow-1.npz" => 50.0..77.0,
            "incomplete-echo-1.npz" => 15.0..20.0,
            "crosstalk-1.npz" => 76.0..128.0,
            _ => 70.0..77.0,
        };
        assert!(expected.contains(&found), "{file}: {found} of {}", most(&sweep));
    }
}
