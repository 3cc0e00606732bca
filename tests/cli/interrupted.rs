//! A run that is killed at any moment goes on to the same bytes.

use crate::{assert_same_tree, edgepuck, exits, meshes, said, succeeds};
use formats::rng::StreamKey;
use std::time::Duration;

/// Number `n` of this process.
fn random_below_300(n: u64) -> u64 {
    StreamKey::new(u64::from(std::process::id()), "kill", 0).below(300, n)
}

#[test]
fn a_killed_run_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    meshes::write_tree(&folder.path().join("meshes"));
    succeeds(folder.path(), "gen-dataset meshes --out unbroken --adapter cpu");
    let words = ["gen-dataset", "meshes", "--out", "broken", "--adapter", "cpu", "--resume"];
    // Moments from before the first scan to the packing, and some that differ
    // on every run; the last runs through.
    let random: Vec<u64> = (0..6).map(random_below_300).collect();
    println!("random moments, ms: {random:?}");
    let fixed = [2, 5, 9, 14, 20, 30, 40, 60, 90, 130, 180, 240, 320];
    for milliseconds in fixed.into_iter().chain(random).chain([60_000]) {
        let mut child =
            edgepuck(folder.path(), &words).stderr(std::process::Stdio::null()).spawn().unwrap();
        let killed_at = std::time::Instant::now() + Duration::from_millis(milliseconds);
        while child.try_wait().unwrap().is_none() && std::time::Instant::now() < killed_at {
            std::thread::sleep(Duration::from_millis(1));
        }
        // SIGKILL: nothing can be tidied up.
        let _ = child.kill();
        child.wait().unwrap();
    }
    assert_same_tree(&folder.path().join("unbroken"), &folder.path().join("broken"));
    let again = succeeds(folder.path(), "gen-dataset meshes --out broken --adapter cpu --resume");
    assert!(said(&again).contains("already complete"), "{}", said(&again));
}

#[test]
fn a_folder_in_use_is_refused_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    meshes::write_tree(&folder.path().join("meshes"));
    succeeds(folder.path(), "gen-dataset meshes --out out --adapter cpu");
    let refused = exits(1, folder.path(), "gen-dataset meshes --out out --adapter cpu");
    assert!(refused.contains("--resume") && refused.contains("--overwrite"), "{refused}");
    let other =
        exits(1, folder.path(), "gen-dataset meshes --out out --adapter cpu --resume --seed 9");
    assert!(other.contains("config.seed: 0 against 9"), "{other}");
    std::fs::write(folder.path().join("out/mine.txt"), "mine").unwrap();
    succeeds(folder.path(), "gen-dataset meshes --out out --adapter cpu --overwrite --seed 9");
    assert!(folder.path().join("out/mine.txt").exists(), "what is not ours stays");
}

#[test]
fn another_list_of_meshes_is_another_dataset() {
    let folder = tempfile::tempdir().unwrap();
    meshes::write_tree(&folder.path().join("meshes"));
    succeeds(folder.path(), "gen-dataset meshes --out out --adapter cpu");
    let added = folder.path().join("meshes/ball/train/ball_0009.off");
    std::fs::write(added, meshes::off(8, 0.5)).unwrap();
    let said = exits(1, folder.path(), "gen-dataset meshes --out out --adapter cpu --resume");
    assert!(said.contains("meshes"), "{said}");
}
