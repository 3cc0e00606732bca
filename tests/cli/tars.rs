//! Tars of samples are the same for any number of tasks, and are handed over once.

use crate::{Folder, meshes, run_for, terminate};
use std::collections::BTreeMap;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

const WORDS: &str = "gen-dataset meshes --adapter cpu --layout webdataset --sensor vlp32c --noise 0.01 --views 3 \
                     --points 64 --azimuth-jitter 180 --tar-clouds 4";

#[test]
fn parts_that_are_killed_and_gone_on_with_are_the_whole() {
    let folder = Folder::with_meshes();
    folder.succeeds(&format!("{WORDS} --out whole"));
    for part in [2, 0, 1] {
        let words = format!("{WORDS} --out parts --resume --shard auto/3");
        for milliseconds in [5, 20, 60, 60_000] {
            let mut run = folder.edgepuck(&words);
            run_for(run.env("SLURM_ARRAY_TASK_ID", part.to_string()), milliseconds);
        }
    }
    let tars = |out: &str| {
        let entries = fs::read_dir(folder.at(out)).unwrap().map(|entry| entry.unwrap().path());
        let mut tars: Vec<_> = entries.filter(|path| path.extension().unwrap() == "tar").collect();
        tars.sort();
        tars.iter()
            .map(|path| (path.file_name().unwrap().to_owned(), fs::read(path).unwrap()))
            .collect::<Vec<_>>()
    };
    assert!(tars("whole").len() > 4);
    assert!(tars("whole") == tars("parts"));
    folder.succeeds("gen-dataset --verify parts");
    let root = fs::read_to_string(folder.at("parts/dataset.json")).unwrap();
    assert!(root.contains("part-0002-of-0003.json"), "{root}");
    fs::write(folder.at("parts/train-000001.tar"), "torn").unwrap();
    let problems = folder.exits(1, "gen-dataset --verify parts");
    assert!(problems.contains("train-000001.tar: was changed"), "{problems}");
}

#[test]
fn one_part_leaves_the_others_alone() {
    let folder = Folder::with_meshes();
    for part in [1, 2] {
        folder.succeeds(&format!("{WORDS} --out out --shard {part}/2"));
    }
    folder.write("out/train-config.json", "mine");
    let before = folder.bytes("out/train-000001.tar");
    folder.succeeds(&format!("{WORDS} --out out --shard 1/2 --overwrite"));
    assert_eq!(folder.bytes("out/train-000001.tar"), before);
    assert_eq!(folder.text("out/train-config.json"), "mine");
    folder.succeeds("gen-dataset --verify out");
    // Meshes of another class would change the meaning of labels.
    folder.write("meshes/aaa/train/a.off", meshes::off(8, 0.5));
    let other = format!("{WORDS} --out out --shard 2/2 --overwrite");
    folder.refuses(2, &[(&other, "this part has other settings, other meshes")]);
}

#[test]
fn missing_tars_are_made_again_and_torn_ones_found() {
    let folder = Folder::with_meshes();
    let words = format!("{WORDS} --out out --hash none");
    folder.succeeds(&words);
    let whole = folder.bytes("out/train-000000.tar");
    folder.write("out/train-000000.tar", &whole[..100]);
    let problems = folder.exits(1, "gen-dataset --verify out");
    assert!(problems.contains("train-000000.tar: holds 100 bytes"), "{problems}");
    folder.succeeds(&format!("{words} --resume"));
    assert_eq!(folder.bytes("out/train-000000.tar"), whole);
    folder.write("out/part-0000-of-0001.json", "{");
    assert!(folder.exits(1, "gen-dataset --verify out").contains("part-0000-of-0001.json"));
    folder.succeeds("gen-dataset meshes --out ordinary --adapter cpu");
    folder.refuses(2, &[(&format!("{WORDS} --out ordinary"), "part of a dataset without tars")]);
}

#[test]
#[cfg(unix)]
fn tars_that_are_there_are_handed_over_later() {
    let folder = Folder::with_meshes();
    folder.succeeds(&format!("{WORDS} --out out"));
    let words = format!("{WORDS} --out out --resume --on-shard");
    let done = folder.edgepuck(&words).arg("echo {name} >> handed").output().unwrap();
    assert!(done.status.success());
    let entries = fs::read_dir(folder.at("out")).unwrap().map(|entry| entry.unwrap().path());
    let tars = entries.filter(|path| path.extension().is_some_and(|e| e == "tar")).count();
    assert_eq!(folder.text("handed").lines().count(), tars);
}

#[test]
#[cfg(unix)]
fn a_tar_is_handed_over_once_and_a_failing_command_is_tried_again() {
    let folder = Folder::with_meshes();
    let run = |command: &str| {
        let words = format!("{WORDS} --out out --resume --on-shard");
        folder.edgepuck(&words).arg(command).output().unwrap()
    };
    // The command fails until there is a folder for the first tar.
    let late = "test -d store || { test -e tried && mkdir store; touch tried; exit 1; }; cp {} store/{name}";
    let done = run(late);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    for tar in fs::read_dir(folder.at("store")).unwrap().map(|tar| tar.unwrap()) {
        let own = folder.at("out").join(tar.file_name());
        assert_eq!(fs::read(own).unwrap(), fs::read(tar.path()).unwrap());
    }
    // All tars were handed over: the command does not run again.
    assert_eq!(run("touch again; false").status.code(), Some(0));
    assert!(!folder.at("again").exists());
}

/// The files of a tar: 512 bytes with the name and, from byte 124, the size in octal digits; then the
/// bytes, padded to 512 (POSIX.1-1988, "ustar").
fn files_of(tar: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let (mut rest, mut files) = (tar, BTreeMap::new());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_matches(['\0', ' ']).to_owned();
    while rest.first().is_some_and(|byte| *byte != 0) {
        let size = usize::from_str_radix(&text(&rest[124..136]), 8).unwrap();
        files.insert(text(&rest[..100]), rest[512..][..size].to_vec());
        rest = &rest[512 + size.next_multiple_of(512)..];
    }
    files
}

#[test]
fn a_scan_of_a_tar_is_that_of_its_class_mesh_and_view() {
    let folder = Folder::with_meshes();
    let words = WORDS.replace("--layout webdataset ", "").replace("--tar-clouds 4", "");
    folder.succeeds(&format!("{words} --out files"));
    folder.succeeds(&format!("{WORDS} --out tars --sample scan"));
    // All meshes are in it once before one is again.
    let both =
        [0, 3].map(|number| files_of(&folder.bytes(&format!("tars/train-00000{number}.tar"))));
    let files: BTreeMap<_, _> = both.into_iter().flatten().collect();
    assert_eq!(files.len(), 2 * 4 * 3, "{:?}", files.keys());
    for (name, json) in files.iter().filter(|(name, _)| name.ends_with(".json")) {
        let told: serde_json::Value = serde_json::from_slice(json).unwrap();
        let mesh = told["mesh"].as_str().unwrap().strip_suffix(".off").unwrap();
        let scan = folder.scan(&format!("files/rotational/noisy/{mesh}_v{}.npz", told["view"]));
        folder.write("one.npz", &files[&name.replace("json", "npz")]);
        assert_eq!(folder.scan("one.npz"), scan, "{told}");
        assert_eq!(told["points"], scan.len());
        let label = ["ball", "donut", "ring"].iter().position(|class| told["class"] == **class);
        assert_eq!(files[&name.replace("json", "cls")], label.unwrap().to_string().into_bytes());
    }
}

#[test]
#[cfg(unix)]
fn a_terminated_run_leaves_no_half_of_a_tar() {
    let folder = Folder::with_meshes();
    let words = format!("{WORDS} --out out --resume --shard 1/2");
    let words = words.replace("--views 3", "--views 900").replace("clouds 4", "clouds 1500");
    let mut codes = Vec::new();
    // One of the signals comes while a tar is written.
    for milliseconds in (0..60).map(|n| 20 + 10 * n) {
        let mut child = folder.edgepuck(&words).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        let _ = terminate(&child);
        let code = child.wait().unwrap().code();
        // The signal itself ends a program that does not handle it yet.
        assert!(matches!(code, Some(0 | 75) | None), "{code:?}");
        for file in fs::read_dir(folder.at("out")).into_iter().flatten() {
            let path = file.unwrap().path();
            assert!(path.with_extension("json").exists(), "{} has no record", path.display());
        }
        codes.push(code);
        if matches!(code, Some(0 | 75)) {
            break;
        }
    }
    assert_eq!(codes.last(), Some(&Some(75)), "{codes:?}");
    folder.succeeds(&words);
}

/// The signal of a scheduler also ends the command. The task has not failed, and can resume.
#[test]
#[cfg(unix)]
fn a_run_terminated_during_a_hand_over_is_interrupted() {
    let folder = Folder::with_meshes();
    let run = |command: &str| {
        let words = format!("{WORDS} --out out --resume --tar-clouds 1000 --on-shard");
        folder.edgepuck(&words.replace("--tar-clouds 4 ", "")).arg(command).output().unwrap()
    };
    let done = run("case {name} in test*) kill -TERM $PPID; exit 1;; esac");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(75), "{said}");
    assert!(said.contains("stopped after 2 of 2 tars"), "{said}");
    assert_eq!(run("true").status.code(), Some(0));
}
