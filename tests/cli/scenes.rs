//! `scan` and `view`.

use crate::{Folder, in_repository, meshes};

/// A scene at `x_m`, with a sensor that stands still or, with a `drive`, has driven 0.3 m after a turn.
fn scene_at(folder: &Folder, name: &str, x_m: f64, drive: Option<&str>) {
    let sensor_m = x_m - 4.0;
    let pose = drive.map_or(format!("position_m = [{sensor_m}, 0, 0.2]\nyaw_deg = 0"), |deskew| {
        let to_m = sensor_m + 3.0;
        format!(
            "trajectory = [{{ time_s = 0, position_m = [{sensor_m}, 0, 0.2], yaw_deg = 0 }}, \
             {{ time_s = 1, position_m = [{to_m}, 0, 0.2], yaw_deg = 0 }}]\n{deskew}"
        )
    });
    let scene = format!(
        "attributes = [\"range\", \"object\", \"sensor\"]\n\
         [[object]]\nmesh = \"torus.off\"\nname = \"near\"\nposition_m = [{x_m}, 0, 0]\n\
         [[object]]\nmesh = \"torus.off\"\nname = \"far\"\nposition_m = [{}, 1, 0.8]\n\
         [[sensor]]\nprofile = \"vlp16\"\n{pose}\n",
        x_m + 3.0
    );
    folder.write(name, scene);
}

#[test]
fn a_scene_moved_by_1e7_m_gives_the_same_scan_to_a_micrometre() {
    let folder = Folder::new();
    folder.write("torus.off", meshes::off(40, 0.3));
    for drive in [None, Some("deskew = false"), Some("deskew = true")] {
        let [here, there] = [("here", 0.0), ("there", 1e7)].map(|(name, x_m)| {
            scene_at(&folder, &format!("{name}.toml"), x_m, drive);
            folder.succeeds(&format!("scan {name}.toml --out {name}.npz --overwrite"));
            folder.scan(&format!("{name}.npz"))
        });
        assert!(here.len() > 500, "{}", here.len());
        assert_eq!(here.object, there.object);
        assert!(
            here.object.as_ref().unwrap().contains(&1),
            "the far torus shows beside the near one"
        );
        for (p, q) in here.range_m.as_ref().unwrap().iter().zip(there.range_m.as_ref().unwrap()) {
            assert!((p - q).abs() <= 1e-6, "{p} {q}");
        }
        let [at_here, at_there] = [&here, &there]
            .map(|scan| [&scan.positions[..], scan.sensor_m.as_ref().unwrap()].concat());
        for (p, q) in at_here.iter().zip(&at_there) {
            for axis in 0..3 {
                let in_world = |scan_origin: f64, p: f32| scan_origin + f64::from(p);
                let moved =
                    in_world(there.origin[axis], q[axis]) - if axis == 0 { 1e7 } else { 0.0 };
                // f64 holds 1e7 m to 1.9 nm; f32 holds 4 m to 0.24 um, twice.
                assert!((in_world(here.origin[axis], p[axis]) - moved).abs() <= 1e-6, "{drive:?}");
            }
        }
    }
}

#[test]
fn the_scene_that_ships_is_scanned_and_drawn() {
    let folder = Folder::new();
    for scene in ["two_chairs", "plain"] {
        let file = in_repository("assets/scenes").join(scene).with_extension("toml");
        let said = folder.succeeds(&format!("scan {} --out {scene}.npz", file.display()));
        assert!(said.contains("points"), "{said}");
        assert!(folder.scan(&format!("{scene}.npz")).len() > 100);
        folder.succeeds(&format!("view {scene}.npz --out {scene}.png"));
        let png = folder.bytes(&format!("{scene}.png"));
        assert!(png.starts_with(b"\x89PNG") && png.len() > 5_000);
    }
    let plain = folder.scan("plain.npz");
    assert_eq!(plain.columns().count(), 0, "what was not asked for is not there");
}
