//! Merged shards have the bytes of one run.

use edgepuck_dataset::internals::{Terms, finish};
use edgepuck_dataset::{DatasetError, DatasetFolder, Entry, MeshFailure, merge, verify};
use formats::Split::{Test, Train};
use std::fs;
use std::path::{Path, PathBuf};
use tests::tree::{assert_same, files};
use tests::written_dataset::{config, entry, failure, terms, write};

fn entries() -> Vec<Entry> {
    let split = |i| if i % 4 == 0 { Test } else { Train };
    let class = |i| ["bowl", "chair", "cup"][i % 3];
    (0..12_usize).map(|i| entry(class(i), split(i), &format!("{}_{i}", class(i)))).collect()
}

/// One is of a class without scanned meshes.
fn failures() -> Vec<MeshFailure> {
    vec![failure("airplane", Train, "airplane_1"), failure("cup", Test, "cup_99")]
}

fn make(out: &Path, terms: &Terms, entries: &[Entry], failures: &[MeshFailure]) {
    let records = write(out, terms, entries);
    finish(DatasetFolder(out), terms, records, failures.to_vec()).expect("a dataset");
}

/// Three shards; the last has a class less, and the others a failure each.
fn make_shards(folder: &Path) -> Vec<PathBuf> {
    let make_shard = |number: u32| {
        let part = entries().into_iter().skip(number as usize).step_by(3).collect::<Vec<_>>();
        let failed: Vec<_> = failures().into_iter().skip(number as usize).take(1).collect();
        let out = folder.join(format!("shard{number}"));
        make(&out, &terms(config(), Some((number, 3))), &part, &failed);
        out
    };
    (0..3).map(make_shard).collect()
}

#[test]
fn merged_shards_are_one_run_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    make(&whole, &terms(config(), None), &entries(), &failures());
    let shards = make_shards(folder.path());
    let before: Vec<_> = shards.iter().map(|shard| files(shard)).collect();
    let merged = folder.path().join("merged");
    let reversed: Vec<_> = shards.iter().rev().cloned().collect();
    let manifest = merge(&reversed, &merged).unwrap();
    assert_eq!(manifest.shard, None);
    assert_same(&whole, &merged);
    assert!(verify(&merged).unwrap().is_sound());
    let after: Vec<_> = shards.iter().map(|shard| files(shard)).collect();
    assert!(before == after, "shards stay as they were");
}

#[test]
fn adapters_are_listed_once_each() {
    let folder = tempfile::tempdir().unwrap();
    let make_shard = |number: u32| {
        let adapter = ["b", "a", "b"][number as usize].to_owned();
        let terms = Terms { adapter, ..terms(config(), Some((number, 3))) };
        let out = folder.path().join(number.to_string());
        make(&out, &terms, &[], &[]);
        out
    };
    let shards: Vec<_> = (0..3).map(make_shard).collect();
    assert_eq!(merge(&shards, &folder.path().join("merged")).unwrap().adapters, ["a", "b"]);
}

#[test]
fn shards_that_do_not_make_a_dataset_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let shards = make_shards(folder.path());
    let [first, second, third] = &shards[..] else { panic!("three shards") };
    let out = folder.path().join("merged");
    let other = |name: &str, terms: &Terms, entries: &[Entry]| {
        let out = folder.path().join(name);
        make(&out, terms, entries, &[]);
        out
    };
    let mut reseeded = config();
    reseeded.seed += 1;
    let whole = other("whole", &terms(config(), None), &[]);
    let of_two = other("of_two", &terms(config(), Some((1, 2))), &[]);
    let reseeded = other("reseeded", &terms(reseeded, Some((1, 3))), &[]);
    let old = Terms { version: "0.0.1".to_owned(), ..terms(config(), Some((1, 3))) };
    let old = other("old", &old, &[]);
    let again = other("again", &terms(config(), Some((1, 3))), &entries()[..1]);
    for (shards, said) in [
        (vec![], "part 1/1 is not among the shards"),
        (vec![first, third], "part 2/3 is not among the shards"),
        (vec![first, second, third, second], "is the same part as"),
        (
            vec![first, &whole, third],
            "expected a shard, found a dataset that was made without --shard",
        ),
        (vec![first, &of_two, third], "is one of 2; "),
        (vec![first, &reseeded, third], "shard0: seed: 8 against 7"),
        (vec![first, &old, third], "was made by version 0.0.1; this is "),
        (vec![first, &again, third], "bowl/bowl_0 (test) is also in "),
    ] {
        let shards: Vec<_> = shards.into_iter().cloned().collect();
        let message = merge(&shards, &out).unwrap_err().to_string();
        assert!(message.contains(said), "{message}");
        assert!(!out.exists(), "nothing is begun");
    }

    let all = &shards[..];
    let occupied = merge(all, first).unwrap_err().to_string();
    assert!(occupied.ends_with("holds files already; merge into an empty folder"), "{occupied}");
    DatasetFolder(second).write_terms(&terms(config(), Some((1, 3)))).unwrap();
    assert!(matches!(merge(all, &out), Err(DatasetError::Unfinished { .. })));
}

#[test]
fn a_failed_merge_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shards = make_shards(folder.path());
    let out = folder.path().join("merged");
    let scan = shards[2].join("static/noisy/cup/train/cup_2_v0.npz");
    fs::write(&scan, "x").unwrap();
    let refused = || {
        let message = merge(&shards, &out).unwrap_err().to_string();
        assert!(message.contains("cup_2_v0.npz"), "{message}");
        assert!(!out.exists(), "it is found before anything is begun");
        message
    };
    assert!(refused().contains("was changed"));
    fs::remove_file(&scan).unwrap();
    refused();
    fs::remove_file(DatasetFolder(&shards[0]).manifest_file()).unwrap();
    assert!(matches!(merge(&shards, &out), Err(DatasetError::NoManifest { .. })));
}
