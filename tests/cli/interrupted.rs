//! A run that is killed at any time resumes, and gives the same bytes.

use crate::{Folder, run_for, terminate};
use formats::rng::StreamKey;
use std::process::Stdio;
use std::time::Duration;

fn random_below_300(n: u64) -> u64 {
    StreamKey::new(u64::from(std::process::id()), "kill", 0).below(300, n)
}

#[test]
fn a_killed_run_resumes_to_the_same_bytes() {
    let folder = Folder::with_meshes();
    folder.succeeds("gen-dataset meshes --out unbroken --adapter cpu");
    let words = "gen-dataset meshes --out broken --adapter cpu --resume";
    // Times from before the first scan to the packing, some of which differ in every run. The last
    // run is not killed.
    let random: Vec<u64> = (0..6).map(random_below_300).collect();
    println!("random moments, ms: {random:?}");
    let fixed = [2, 5, 9, 14, 20, 30, 40, 60, 90, 130, 180, 240, 320];
    for milliseconds in fixed.into_iter().chain(random).chain([60_000]) {
        run_for(&mut folder.edgepuck(words), milliseconds);
    }
    folder.assert_same_tree("unbroken", "broken");
    let again = folder.succeeds(words);
    assert!(again.contains("already complete"), "{again}");
}

#[test]
#[cfg(unix)]
fn a_terminated_run_says_so_and_resumes() {
    let folder = Folder::with_meshes();
    folder.succeeds("gen-dataset meshes --out unbroken --adapter cpu");
    let words = "gen-dataset meshes --out broken --adapter cpu --resume";
    let mut codes = Vec::new();
    // One of the signals comes while meshes are scanned.
    for milliseconds in (0..40).map(|n| 3 + 4 * n) {
        let mut child = folder.edgepuck(words).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        let was_there = terminate(&child);
        let code = child.wait().unwrap().code();
        // The signal itself ends a program that does not handle it yet.
        assert!(matches!(code, Some(0 | 75) | None), "{code:?}");
        codes.push(code);
        if code == Some(0) || !was_there {
            break;
        }
    }
    folder.succeeds(words);
    folder.assert_same_tree("unbroken", "broken");
    assert!(codes.contains(&Some(75)), "{codes:?}");
}

/// As after `2>&1 | head -1`.
#[test]
fn a_reader_of_messages_that_leaves_does_not_end_the_work() {
    let folder = Folder::with_meshes();
    for (words, file) in [
        ("gen-dataset meshes --out set --adapter cpu", "set/manifest.json"),
        ("gen-scenes yard --sweeps 10 --save 1 --adapter cpu --out yard", "yard/packed/train.npz"),
        ("detect yard/sweeps/000000.npz --out objects.json", "objects.json"),
    ] {
        let mut child = folder.edgepuck(words).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stderr.take());
        assert_eq!(child.wait().unwrap().code(), Some(0), "{words}");
        assert!(folder.at(file).exists(), "{words}");
    }
}

#[test]
#[cfg(unix)]
fn a_program_that_is_ended_leaves_nothing_unfinished() {
    for (words, kept) in [
        ("gen-dataset --save-meshes d --train 100000", &[][..]),
        ("gen-scenes --drive 3600 --out d/d.pcap", &[][..]),
        ("gen-scenes --drive 3600 --layout semantickitti --out d/sequences", &[][..]),
        ("gen-scenes --sweeps 100000 --save 1 --out d", &["preview.png", "sweeps"]),
    ] {
        let folder = Folder::new();
        let mut child = folder.edgepuck(words).stderr(Stdio::null()).spawn().unwrap();
        let is_begun = || {
            let mut files = std::fs::read_dir(folder.at("d")).into_iter().flatten();
            files.next().is_some() && kept.iter().all(|name| folder.at("d").join(name).exists())
        };
        while !is_begun() {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(50));
        assert!(terminate(&child), "{words}");
        assert_eq!(child.wait().unwrap().code(), None, "{words}");
        let left = std::fs::read_dir(folder.at("d")).unwrap().map(|file| file.unwrap().file_name());
        let mut left: Vec<_> = left.collect();
        left.sort();
        assert_eq!(left, kept, "{words}");
        if kept.contains(&"sweeps") {
            folder.refuses(2, &[(words, "sweeps: it exists already: --overwrite replaces it")]);
        }
    }
}
