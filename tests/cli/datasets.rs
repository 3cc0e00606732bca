//! `gen-dataset`: the same bytes whatever the way they are made.

use crate::{assert_same_tree, exits, meshes, said, succeeds, tree};
use formats::labelled::read_labelled;
use formats::scan_file::read_scan;
use std::path::Path;

fn meshes_in(folder: &Path) {
    meshes::write_tree(&folder.join("meshes"));
}

#[test]
fn the_default_sets_are_written_packed_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    let output = succeeds(folder.path(), "gen-dataset meshes --out out");
    assert!(said(&output).contains("9 meshes, 0 failed; 90 scans"), "{}", said(&output));
    let out = folder.path().join("out");
    for set in ["rotational", "static"] {
        for variant in ["clean", "noisy"] {
            let scan =
                read_scan(&out.join(format!("{set}/{variant}/donut/test/donut_0003_v0.npz")));
            assert!(scan.unwrap().len() > 500);
            let packed =
                read_labelled(&out.join(format!("packed/{set}-{variant}-train.npz"))).unwrap();
            assert_eq!(packed.classes.as_ref().unwrap()[..], ["ball", "donut", "ring"]);
            assert_eq!(packed.n_points, 1024);
            assert_eq!(packed.len(), if set == "rotational" { 6 * 4 } else { 6 });
        }
    }
    assert!(out.join("example.png").exists());
    assert!(!out.join("journal").exists() && !out.join("failures.jsonl").exists());
    succeeds(folder.path(), "gen-dataset --verify out");

    std::fs::write(out.join("static/clean/ring/test/ring_0003_v0.npz"), b"no scan").unwrap();
    std::fs::remove_file(out.join("static/noisy/ring/test/ring_0003_v0.npz")).unwrap();
    let problems = exits(1, folder.path(), "gen-dataset --verify out");
    assert!(problems.contains("static/clean/ring/test/ring_0003_v0.npz"), "{problems}");
    assert!(problems.contains("static/noisy/ring/test/ring_0003_v0.npz"), "{problems}");
}

#[test]
fn culling_does_not_change_a_byte() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    succeeds(folder.path(), "gen-dataset meshes --out culled");
    succeeds(folder.path(), "gen-dataset meshes --out all --no-cull");
    assert_same_tree(&folder.path().join("culled"), &folder.path().join("all"));
}

#[test]
fn one_thread_gives_the_bytes_of_many() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    for (threads, out) in [("1", "one"), ("5", "many")] {
        let words = ["gen-dataset", "meshes", "--out", out, "--adapter", "cpu"];
        let mut command = crate::edgepuck(folder.path(), &words);
        let status = command.env("RAYON_NUM_THREADS", threads).status().unwrap();
        assert!(status.success());
    }
    assert_same_tree(&folder.path().join("one"), &folder.path().join("many"));
}

#[test]
fn merged_shards_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    std::fs::write(folder.path().join("meshes/ring/train/broken.off"), "OFF\n1 1 0\n").unwrap();
    exits(1, folder.path(), "gen-dataset meshes --out whole");
    for shard in 1..=3 {
        // The broken mesh falls into one of the shards.
        let words = format!("gen-dataset meshes --out part{shard} --shard {shard}/3");
        crate::run(folder.path(), &words);
    }
    // What failed in a part failed in the whole.
    exits(1, folder.path(), "merge-dataset part1 part3 part2 --out merged");
    assert_same_tree(&folder.path().join("whole"), &folder.path().join("merged"));
    let missing = exits(1, folder.path(), "merge-dataset part1 part3 --out incomplete");
    assert!(missing.contains('2'), "{missing}");
}

#[test]
fn a_mesh_added_moves_no_other() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    succeeds(folder.path(), "gen-dataset meshes --out before --adapter cpu");
    let added = folder.path().join("meshes/ball/train/ball_0000.off");
    std::fs::write(added, meshes::off(8, 0.5)).unwrap();
    succeeds(folder.path(), "gen-dataset meshes --out after --adapter cpu");
    let (before, after) = (tree(&folder.path().join("before")), tree(&folder.path().join("after")));
    for (path, bytes) in before.iter().filter(|(path, _)| path.starts_with("rotational")) {
        assert!(bytes == &after[path], "{} differs", path.display());
    }
}

#[test]
fn what_is_asked_for_is_there_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    let words = "gen-dataset meshes --out out --sensor vlp16 --views 2 --distance 4 --noise 0 \
                 --format ply,csv --attributes range,ring,intensity,normal --points 128";
    succeeds(folder.path(), words);
    let out = folder.path().join("out");
    assert!(!out.join("static").exists() && !out.join("rotational/noisy").exists());
    let scans = out.join("rotational/clean/ball/test");
    let npz = read_scan(&scans.join("ball_0003_v1.npz")).unwrap();
    assert!(npz.intensity.is_some() && npz.normal.is_some() && npz.beam.is_none());
    assert_eq!(read_scan(&scans.join("ball_0003_v1.ply")).unwrap().positions, npz.positions);
    let csv = std::fs::read_to_string(scans.join("ball_0003_v1.csv")).unwrap();
    assert_eq!(csv.lines().count(), npz.len() + 1);
    let plain = succeeds(folder.path(), "gen-dataset meshes --out plain --noise 0");
    assert!(plain.status.success());
    let scan = folder.path().join("plain/rotational/clean/ball/test/ball_0003_v1.npz");
    assert_eq!(read_scan(&scan).unwrap().columns().count(), 0);
}

#[test]
fn noise_is_along_the_ray_and_of_the_size_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    meshes_in(folder.path());
    succeeds(folder.path(), "gen-dataset meshes --out out --noise 0.02 --attributes range,beam");
    let scan = |variant: &str| {
        let file = format!("out/rotational/{variant}/ball/train/ball_0001_v0.npz");
        read_scan(&folder.path().join(file)).unwrap()
    };
    let (clean, noisy) = (scan("clean"), scan("noisy"));
    assert_eq!(clean.beam, noisy.beam);
    let ranges = clean.range_m.unwrap().into_iter().zip(noisy.range_m.unwrap());
    let errors: Vec<f64> = ranges.map(|(p, q)| f64::from(q) - f64::from(p)).collect();
    let n = errors.len() as f64;
    let sigma = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    // The standard error of a standard deviation is sigma / sqrt(2 n): five.
    assert!((sigma - 0.02).abs() < 5.0 * 0.02 / (2.0 * n).sqrt(), "{sigma} over {n}");
}
