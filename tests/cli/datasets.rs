//! `gen-dataset`: the same bytes for any threads, shards and interruptions.

use crate::{Folder, meshes};
use formats::labelled::read_labelled;

#[test]
fn the_default_sets_are_written_packed_and_verified() {
    let folder = Folder::with_meshes();
    let said = folder.succeeds("gen-dataset meshes --noise 0.01 --out out");
    assert!(said.contains("9 meshes, 0 failed; 90 scans"), "{said}");
    for set in ["rotational", "static"] {
        for variant in ["clean", "noisy"] {
            let scan = format!("out/{set}/{variant}/donut/test/donut_0003_v0.npz");
            assert!(folder.scan(&scan).len() > 500);
            let packed = format!("out/packed/{set}-{variant}-train.npz");
            let packed = read_labelled(&folder.at(&packed)).unwrap();
            assert_eq!(packed.classes.as_ref().unwrap()[..], ["ball", "donut", "ring"]);
            assert_eq!(packed.smallest_cloud(), 1024);
            assert_eq!(packed.len(), if set == "rotational" { 6 * 4 } else { 6 });
        }
    }
    assert!(folder.at("out/example.png").exists());
    assert!(!folder.at("out/journal").exists() && !folder.at("out/failures.jsonl").exists());
    folder.succeeds("gen-dataset --verify out");

    let [changed, lost] =
        ["clean", "noisy"].map(|v| format!("static/{v}/ring/test/ring_0003_v0.npz"));
    folder.write(&format!("out/{changed}"), "no scan");
    std::fs::remove_file(folder.at(&format!("out/{lost}"))).unwrap();
    let problems = folder.exits(1, "gen-dataset --verify out");
    assert!(problems.contains(&changed) && problems.contains(&lost), "{problems}");
}

#[test]
fn one_thread_gives_the_bytes_of_many_and_a_mesh_added_moves_no_other() {
    let folder = Folder::with_meshes();
    for (threads, out) in [("1", "one"), ("5", "many")] {
        let mut command = folder.edgepuck(&format!("gen-dataset meshes --out {out} --adapter cpu"));
        assert!(command.env("RAYON_NUM_THREADS", threads).status().unwrap().success());
    }
    folder.assert_same_tree("one", "many");
    folder.write("meshes/ball/train/ball_0000.off", meshes::off(8, 0.5));
    folder.succeeds("gen-dataset meshes --out after --adapter cpu");
    let [before, after] = ["one", "after"].map(|out| tests::tree::files(&folder.at(out)));
    for (path, bytes) in before.iter().filter(|(path, _)| path.starts_with("rotational")) {
        assert!(bytes == &after[path], "{} differs", path.display());
    }
}

#[test]
fn merged_shards_are_the_whole() {
    let folder = Folder::with_meshes();
    folder.write("meshes/ring/train/broken.off", "OFF\n1 1 0\n");
    // Merging reads the clouds from files that a single run keeps in memory.
    const SETTINGS: &str = "--sensor vlp16 --views 1 --attributes normal";
    folder.exits(3, &format!("gen-dataset meshes --out whole {SETTINGS}"));
    for shard in 1..=2 {
        // The broken mesh falls into one of the shards, which fails.
        let words = format!("gen-dataset meshes --out part{shard} --shard {shard}/2 {SETTINGS}");
        folder.edgepuck(&words).output().unwrap();
    }
    // A mesh that failed in a part also failed in the whole.
    folder.exits(3, "merge-dataset part2/manifest.json part1 --out merged");
    folder.assert_same_tree("whole", "merged");
}

#[test]
fn outputs_are_the_requested_ones_alone() {
    let folder = Folder::with_meshes();
    folder.succeeds(
        "gen-dataset meshes --out out --sensor vlp16 --views 2 --distance 4 --noise 0 \
         --format ply,csv --attributes range,ring,intensity,normal --points 128",
    );
    assert!(!folder.at("out/static").exists() && !folder.at("out/rotational/noisy").exists());
    let scan = "rotational/clean/ball/test/ball_0003_v1";
    let npz = folder.scan(&format!("out/{scan}.npz"));
    assert!(npz.intensity.is_some() && npz.normal.is_some() && npz.beam.is_none());
    assert_eq!(folder.scan(&format!("out/{scan}.ply")).positions, npz.positions);
    assert_eq!(folder.text(&format!("out/{scan}.csv")).lines().count(), npz.len() + 1);
    folder
        .succeeds("gen-dataset meshes --sensor vlp16 --views 2 --out plain --noise 0 --hash none");
    assert!(!folder.text("plain/manifest.json").contains("sha256"));
    let said = folder.succeeds("gen-dataset --verify plain");
    assert!(said.contains("without hashes to compare, 0 problems"), "{said}");
    assert_eq!(folder.scan(&format!("plain/{scan}.npz")).columns().count(), 0);
}

#[test]
fn effects_come_from_a_file_and_dark_meshes_are_not_detected() {
    let folder = Folder::with_meshes();
    // A ball of radius 1, 3 m away: its nearest point is 2 m away.
    folder.write("limit.toml", "[effects]\ndetection = { reflectivity = 1, range_m = 2.5 }\n");
    let words = "gen-dataset meshes --sensor vlp32c --effects limit.toml --attributes reflectivity";
    folder.succeeds(&format!("{words} --out white"));
    folder.exits(3, &format!("{words} --out grey --reflectivity 0.5"));
    let scan = |variant: &str| {
        folder.scan(&format!("{variant}/ball/train/ball_0001_v0.npz")).reflectivity.unwrap()
    };
    let (clean, noisy) = (scan("white/rotational/clean"), scan("white/rotational/noisy"));
    assert!(!noisy.is_empty() && noisy.len() < clean.len());
    // 1 / 2.5^2 times the square of a range of 2 m or more.
    assert!(noisy.iter().all(|&byte| byte >= 64) && clean.iter().any(|&byte| byte < 64));
    assert!(scan("grey/rotational/noisy").is_empty());
    let manifest = folder.text("grey/manifest.json");
    assert!(manifest.contains("\"reflectivity\": 0.5") && manifest.contains("\"undetected\": "));
}

#[test]
fn noise_is_along_the_ray_and_of_the_size_asked_for() {
    let folder = Folder::with_meshes();
    folder.succeeds("gen-dataset meshes --sensor vlp16 --views 1 --out out --noise 0.02 --attributes range,beam");
    let [clean, noisy] = ["clean", "noisy"].map(|variant| {
        folder.scan(&format!("out/rotational/{variant}/ball/train/ball_0001_v0.npz"))
    });
    assert_eq!(clean.beam, noisy.beam);
    let ranges = clean.range_m.unwrap().into_iter().zip(noisy.range_m.unwrap());
    let errors: Vec<f64> = ranges.map(|(p, q)| f64::from(q) - f64::from(p)).collect();
    let n = errors.len() as f64;
    let sigma = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    // The standard error of a standard deviation is sigma / sqrt(2 n): five.
    assert!((sigma - 0.02).abs() < 5.0 * 0.02 / (2.0 * n).sqrt(), "{sigma} over {n}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_not_unicode_does_not_stop_the_others() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::with_meshes();
    let name = std::ffi::OsStr::from_bytes(b"ring_\xE9.off");
    std::fs::write(folder.at("meshes/ring/train").join(name), meshes::off(8, 0.1)).unwrap();
    let said =
        folder.exits(3, "gen-dataset meshes --out out --adapter cpu --sensor vlp16 --views 1");
    assert!(said.contains("9 meshes, 1 failed"), "{said}");
    assert!(said.contains(r"failed: ring/train/ring_\xE9.off: "), "{said}");
    assert!(said.contains("the path is not Unicode; rename it"), "{said}");
}
