//! `scan` and `preview`.

use crate::{meshes, said, succeeds};
use formats::scan_file::read_scan;
use std::fs;
use std::path::Path;

fn scene_at(folder: &Path, name: &str, x_m: f64) {
    let scene = format!(
        "attributes = [\"range\", \"object\"]\n\
         [[object]]\nmesh = \"torus.off\"\nname = \"near\"\nposition_m = [{x_m}, 0, 0]\n\
         [[object]]\nmesh = \"torus.off\"\nname = \"far\"\nposition_m = [{}, 1, 0.8]\n\
         [[sensor]]\nprofile = \"vlp16\"\nposition_m = [{}, 0, 0.2]\nlook_at_m = [{x_m}, 0, 0]\n",
        x_m + 3.0,
        x_m - 4.0
    );
    fs::write(folder.join(name), scene).unwrap();
}

#[test]
fn a_scene_moved_by_1e7_m_gives_the_same_scan_to_a_micrometre() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("torus.off"), meshes::off(40, 0.3)).unwrap();
    scene_at(folder.path(), "here.toml", 0.0);
    scene_at(folder.path(), "there.toml", 1e7);
    for name in ["here", "there"] {
        succeeds(folder.path(), &format!("scan {name}.toml --out {name}.npz"));
    }
    let here = read_scan(&folder.path().join("here.npz")).unwrap();
    let there = read_scan(&folder.path().join("there.npz")).unwrap();
    assert!(here.len() > 500, "{}", here.len());
    assert_eq!(here.object, there.object);
    assert!(here.object.unwrap().contains(&1), "the far torus shows beside the near one");
    for (p, q) in here.range_m.unwrap().iter().zip(&there.range_m.unwrap()) {
        assert!((p - q).abs() <= 1e-6, "{p} {q}");
    }
    for (p, q) in here.positions.iter().zip(&there.positions) {
        for axis in 0..3 {
            let in_world = |scan_origin: f64, p: f32| scan_origin + f64::from(p);
            let moved = in_world(there.origin[axis], q[axis]) - if axis == 0 { 1e7 } else { 0.0 };
            // f64 holds 1e7 m to 1.9 nm; f32 holds 4 m to 0.24 um, twice.
            assert!((in_world(here.origin[axis], p[axis]) - moved).abs() <= 1e-6);
        }
    }
}

#[test]
fn the_scene_that_ships_is_scanned_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/scenes");
    for scene in ["two_chairs", "plain"] {
        let file = scenes.join(scene).with_extension("toml");
        let output = succeeds(folder.path(), &format!("scan {} --out {scene}.npz", file.display()));
        assert!(said(&output).contains("points"), "{}", said(&output));
        assert!(read_scan(&folder.path().join(format!("{scene}.npz"))).unwrap().len() > 100);
        succeeds(folder.path(), &format!("preview {scene}.npz --out {scene}.png"));
        let png = fs::read(folder.path().join(format!("{scene}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG") && png.len() > 5_000);
    }
    let plain = read_scan(&folder.path().join("plain.npz")).unwrap();
    assert_eq!(plain.columns().count(), 0, "what was not asked for is not there");
}

#[test]
fn without_a_scene_the_default_one_is_written_and_scanned() {
    let folder = tempfile::tempdir().unwrap();
    let output = succeeds(folder.path(), "scan --adapter cpu --out scan.npz");
    assert!(folder.path().join("data/default-scene/scenes/two_chairs.toml").is_file());
    assert!(!said(&output).contains(" 0 points") && folder.path().join("scan.npz").is_file());
}
