//! `scan` of meshes, the unit of their coordinates, and outputs that exist already.

use crate::Folder;

/// An OBJ of a box, y up: `size` long, wide and high, with a corner at `x`.
fn box_at(x: f64, size: [f64; 3]) -> String {
    let mut obj = String::new();
    for corner in 0..8u8 {
        let side = |axis: u8| size[usize::from(axis)] * f64::from(corner >> axis & 1);
        obj += &format!("v {} {} {}\n", x + side(0), side(2), -side(1));
    }
    obj + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

#[test]
fn meshes_are_scanned_where_their_files_have_them() {
    let folder = Folder::new();
    folder.write("near.obj", box_at(10.0, [1.0, 2.0, 1.5]));
    folder.write("far.obj", box_at(13.0, [1.0, 2.0, 1.5]));
    let view = "--sensor generic-static --distance 6 --elevation 0 --azimuth 180 --seed 3";
    folder.succeeds(&format!("scan near.obj far.obj {view} --out both.npz --adapter cpu"));
    let scan = folder.scan("both.npz");
    // The boxes take up 10 to 14 m: the sensor stands at x = 6, and sees the side at 10.
    let nearest = scan.positions.iter().map(|p| p[0]).fold(f32::INFINITY, f32::min);
    assert!((nearest - 10.0).abs() < 1e-5, "{nearest}");
    let ranges = scan.range_m.as_ref().unwrap().iter().copied();
    assert!((ranges.fold(f32::INFINITY, f32::min) - 4.0).abs() < 1e-2);
    assert!(scan.object.as_ref().unwrap().iter().all(|&object| object <= 1));
    folder.succeeds(&format!("scan near.obj {view} --noise 0.01 --out noisy.ply --adapter cpu"));
    assert!(folder.bytes("noisy.ply").starts_with(b"ply\n"));
}

#[test]
fn a_mesh_in_millimetres_is_read_by_its_unit_or_warned_of() {
    let folder = Folder::new();
    folder.write("mm.obj", box_at(0.0, [450.0, 400.0, 900.0]));
    folder.write("m.obj", box_at(0.0, [0.45, 0.4, 0.9]));
    let scan = |words: &str| folder.succeeds(&format!("scan {words} --adapter cpu"));
    let quiet = scan("mm.obj --units mm --out mm.csv") + &scan("m.obj --out m.csv");
    assert!(!quiet.contains("warning"), "{quiet}");
    assert_eq!(folder.text("mm.csv"), folder.text("m.csv"));
    // The walls are out of range.
    let said = folder.exits(3, "scan mm.obj --distance 3 --out inside.npz --adapter cpu");
    for part in [
        "warning: mm.obj: expected a size of 1 cm to 100 m, found 450 x 400 x 900 m if its unit is \
         the metre (0.45 x 0.4 x 0.9 m if it is millimetres); --units names another unit",
        "warning: mm.obj: the sensor stands inside its bounding box",
    ] {
        assert!(said.contains(part), "{said}");
    }
    folder.write("km.obj", box_at(0.0, [9e5, 9e5, 9e5]));
    let said = folder.exits(3, "scan km.obj --units mm --out km.npz --adapter cpu");
    assert!(said.contains("found 900 x 900 x 900 m if its unit is millimetres; --units"), "{said}");
    let sensor = "[[sensor]]\nprofile = \"vlp32c\"\nposition_m = [-2, 0, 0.5]\nyaw_deg = 0\n";
    for (units, is_doubted) in [("", true), ("units = \"mm\"\n", false)] {
        let object = format!("[[object]]\nmesh = \"mm.obj\"\nup = \"z\"\n{units}");
        folder.write("scene.toml", object + sensor);
        let output =
            folder.edgepuck("scan scene.toml --out s.npz --overwrite --adapter cpu").output();
        let said = String::from_utf8_lossy(&output.unwrap().stderr).into_owned();
        assert_eq!(said.contains("mm.obj: expected a size of 1 cm to 100 m"), is_doubted, "{said}");
    }
    let said = folder.exits(3, "scan m.obj --distance 900 --out none.npz --adapter cpu");
    assert!(said.contains("no beam returned a point"), "{said}");
}

#[test]
fn units_of_a_data_set_are_those_of_its_meshes() {
    let folder = Folder::new();
    folder.write("mm/box/train/a.obj", box_at(0.0, [450.0, 400.0, 900.0]));
    let make = "gen-dataset mm --normalize none --sensor vlp32c --views 1 --adapter cpu";
    let said = folder.succeeds(&format!("{make} --units mm --out right"));
    assert!(!said.contains("expected a size"), "{said}");
    let manifest = folder.text("right/manifest.json");
    assert!(manifest.contains("\"units\": \"mm\"") && manifest.contains("\"scale\": 0.001"));
    let said = folder.exits(3, &format!("{make} --out wrong"));
    assert!(
        said.contains("a.obj: expected a size of 1 cm to 100 m, found 450 x 400 x 900"),
        "{said}"
    );
    assert!(said.contains("a.obj: a sensor stands inside its bounding box"), "{said}");
    let far = format!("{make} --units mm --distance 300 --out far");
    let said = folder.exits(3, &far);
    assert!(said.contains("No scan of rotational holds a point"), "{said}");
}

#[test]
fn flags_that_do_not_fit_the_input_are_refused() {
    let folder = Folder::new();
    folder.write("a.obj", box_at(0.0, [1.0; 3]));
    folder.write("room.toml", "[[object]]\nmesh = \"a.obj\"\n[[sensor]]\nprofile = \"vlp16\"\n");
    folder.refuses(
        2,
        &[
            ("scan room.toml --distance 3 --out a.npz", "--distance applies to scans of meshes"),
            ("scan room.toml --noise 0.1 --out a.npz", "--noise applies to scans of meshes"),
            ("scan a.obj room.toml --out a.npz", "expected one scene, or meshes (.obj, .off"),
            ("scan a.obj --elevation 500 --out a.npz", "expected degrees from -90 to 90"),
            ("scan a.obj --units km --out a.npz", "expected one of m, mm, cm, in, ft"),
            ("gen-dataset . --units mm --out d", "--units applies to --normalize none"),
        ],
    );
    assert!(!folder.at("a.npz").exists());
}

#[test]
fn an_output_that_exists_is_replaced_only_if_asked() {
    let folder = Folder::new();
    folder.write("a.obj", box_at(0.0, [1.0; 3]));
    folder.write("a.npz", "mine");
    let scan = "scan a.obj --adapter cpu --out a.npz";
    folder.refuses(2, &[(scan, "a.npz: it exists already: --overwrite replaces it")]);
    assert_eq!(folder.text("a.npz"), "mine");
    folder.succeeds(&format!("{scan} --overwrite"));
    assert!(!folder.scan("a.npz").is_empty());
    let scenes = "gen-scenes room --sweeps 1 --save 1 --adapter cpu --out s";
    folder.succeeds(scenes);
    folder.refuses(2, &[(scenes, "s/packed: it exists already")]);
    folder.write("s/sweeps/000009.npz", "of another set");
    folder.succeeds(&format!("{scenes} --overwrite"));
    assert!(!folder.at("s/sweeps/000009.npz").exists());
    // A file is no folder to replace, nor a folder a file.
    folder.write("folder.npz/a", "mine");
    let folder_found = "folder.npz: expected a file to write, found a folder: name another";
    let file_found = "a.obj: expected a folder to write, found a file: name another";
    for flag in ["", "--overwrite"] {
        folder.refuses(
            2,
            &[
                (&format!("scan a.obj --out folder.npz {flag}"), folder_found),
                (&format!("segment a.npz --out a.obj {flag}"), file_found),
            ],
        );
    }
}
