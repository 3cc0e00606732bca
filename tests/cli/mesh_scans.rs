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
fn a_mesh_in_millimetres_is_read_by_its_unit() {
    let folder = Folder::new();
    folder.write("mm.obj", box_at(0.0, [450.0, 400.0, 900.0]));
    folder.write("m.obj", box_at(0.0, [0.45, 0.4, 0.9]));
    let scan = |words: &str| folder.succeeds(&format!("scan {words} --adapter cpu"));
    let quiet = scan("mm.obj --units mm --out mm.csv") + &scan("m.obj --out m.csv");
    assert!(!quiet.contains("warning"), "{quiet}");
    assert_eq!(folder.text("mm.csv"), folder.text("m.csv"));
}
