//! `gen-dataset --simplify`: fewer triangles within a bound, and the manifest says so.

use crate::{assert_same_tree, meshes, said, succeeds};
use formats::scan_file::read_scan;
use serde_json::Value;
use std::path::Path;

/// 20,000 triangles, most of them smaller than the VLP-32C can tell apart from 3 m.
fn fine_torus(folder: &Path) {
    let folder = folder.join("meshes/ring/test");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("ring_0001.off"), meshes::off(100, 0.3)).unwrap();
}

fn manifest(out: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(out.join("manifest.json")).unwrap()).unwrap()
}

#[test]
fn the_manifest_says_what_was_simplified_and_how_far() {
    let folder = tempfile::tempdir().unwrap();
    fine_torus(folder.path());
    let output = succeeds(folder.path(), "gen-dataset meshes --simplify auto --out out");
    let manifest = manifest(&folder.path().join("out"));
    assert_eq!(manifest["config"]["simplify"], "auto");
    let mesh = &manifest["meshes"][0];
    let (before, after) = (&mesh["triangles"], &mesh["simplified"]["triangles"]);
    assert_eq!(before.as_u64(), Some(20_000));
    assert!(after.as_u64().unwrap() < 10_000, "{after}");
    // A quarter of the VLP-32C's smallest step, 0.33 degrees in elevation or 0.2 in azimuth at
    // 600 rpm, at the nearest point, 2 m away, is 1.7 mm: Sensor's own test has it exactly.
    let bound_m = mesh["simplified"]["bound_m"].as_f64().unwrap();
    assert!((0.001..0.003).contains(&bound_m), "{bound_m}");
    let told = format!("simplified: {after} triangles cast at for {before} in the files");
    assert!(said(&output).contains(&told), "{}", said(&output));
    succeeds(folder.path(), "gen-dataset --verify out");
}

#[test]
fn a_dataset_of_simplified_meshes_is_the_same_again_and_keeps_its_hits() {
    let folder = tempfile::tempdir().unwrap();
    fine_torus(folder.path());
    for (words, threads) in [("one --simplify 0.001", "1"), ("many --simplify 0.001", "5")] {
        let words: Vec<&str> =
            "gen-dataset meshes --out".split(' ').chain(words.split(' ')).collect();
        let mut command = crate::edgepuck(folder.path(), &words);
        assert!(command.env("RAYON_NUM_THREADS", threads).status().unwrap().success());
    }
    succeeds(folder.path(), "gen-dataset meshes --out whole");
    let [one, many, whole] = ["one", "many", "whole"].map(|out| folder.path().join(out));
    assert_same_tree(&one, &many);
    let points = |out: &Path| {
        read_scan(&out.join("rotational/clean/ring/test/ring_0001_v0.npz")).unwrap().len() as f64
    };
    // A millimetre of 1 m moves the silhouette by as much: of a ring as thick as
    // this, less than 1 point in 100.
    assert!((points(&one) / points(&whole) - 1.0).abs() < 0.01);
}

#[test]
fn without_the_flag_the_manifest_does_not_know_the_word() {
    let folder = tempfile::tempdir().unwrap();
    fine_torus(folder.path());
    succeeds(folder.path(), "gen-dataset meshes --out out");
    let text = std::fs::read_to_string(folder.path().join("out/manifest.json")).unwrap();
    assert!(!text.contains("simplif"), "{text}");
}
