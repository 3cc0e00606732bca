//! Finishing a dataset gives the same bytes after any interruption, and verifying it finds every
//! change.

use edgepuck_dataset::internals::{Terms, finish};
use edgepuck_dataset::{
    DatasetConfig, DatasetError, DatasetFolder, Entry, Layout, Manifest, MeshFailure, Poses, verify,
};
use formats::Split::{Test, Train};
use formats::hash::Hashing;
use formats::labelled::read_labelled;
use glam::DVec3;
use sim_gpu::Sensor;
use std::fs;
use std::path::Path;
use tests::tree::files;
use tests::written_dataset::{MIN_POINTS, PACKED_POINTS, config, entry, failure, terms, write};

fn entries() -> Vec<Entry> {
    let mut entries =
        vec![entry("cup", Test, "cup_1"), entry("cup", Train, "X"), entry("cup", Train, "cup_x")];
    for i in 0..4 {
        entries.push(entry("chair", Train, &format!("chair_{i}")));
        entries.push(entry("cup", Train, &format!("cup_{i}")));
    }
    entries
}

/// The failures are of a class without scanned meshes, which has a label all the same.
fn failures() -> Vec<MeshFailure> {
    vec![failure("bowl", Train, "bowl_2"), failure("bowl", Test, "bowl_1")]
}

fn make(out: &Path) -> Manifest {
    make_hashed(out, Hashing::default())
}

fn make_hashed(out: &Path, hash: Hashing) -> Manifest {
    let terms = terms(DatasetConfig { hash, ..config() }, None);
    let records = write(out, &terms, &entries());
    finish(DatasetFolder(out), &terms, records, failures()).expect("a dataset")
}

#[test]
fn a_finished_dataset_is_what_its_manifest_says() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let manifest = make(out);
    assert_eq!(DatasetFolder(out).manifest().unwrap(), manifest);
    assert!(manifest.meshes.is_sorted_by_key(|record| &record.entry));
    assert_eq!(manifest.classes(), ["bowl", "chair", "cup"]);
    let meshes = manifest.terms().meshes;
    assert_eq!(manifest.terms(), Terms { meshes, ..terms(config(), None) });
    assert!(!out.join("journal").exists());

    let report = verify(out).unwrap();
    assert!(report.is_sound(), "{report:?}");
    // Eleven meshes, three views, two variants.
    assert_eq!(report.scans, 66);
    let left_out: usize = manifest.packed.iter().map(|packed| packed.left_out.len()).sum();
    assert_eq!(report.clouds + left_out as u64, 66);

    assert!(left_out > 0, "the datasets of this test hold small scans");

    fs::write(out.join("notes.txt"), "mine").unwrap();
    assert!(verify(out).unwrap().is_sound(), "beside the manifest files are the user's");

    let lines = fs::read_to_string(DatasetFolder(out).failures_file()).unwrap();
    let first =
        r#"{"class":"bowl","split":"train","name":"bowl_2","source":"bowl/train/bowl_2.off","#;
    assert!(lines.starts_with(first) && lines.lines().count() == 2, "{lines}");

    // The rotating sensor stands at the same places for every mesh; the camera's
    // places are jittered.
    let config = config();
    let Poses::EveryMesh(poses) = &manifest.poses[0].poses else { panic!("not jittered") };
    assert_eq!(*poses, config.sets[0].poses(config.seed, "any", DVec3::ZERO));
    let Poses::EachMesh(meshes) = &manifest.poses[1].poses else { panic!("jittered") };
    // Eleven meshes, of which cup/cup_1 is in both splits.
    assert_eq!(meshes.len(), 10);
    for mesh in meshes {
        assert_eq!(mesh.poses, config.sets[1].poses(config.seed, &mesh.id, DVec3::ZERO));
    }
}

#[test]
fn packed_sets_hold_all_scans_of_enough_points() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = make(folder.path());
    assert_eq!(manifest.packed.len(), 8);
    for packed in &manifest.packed {
        let set = read_labelled(&folder.path().join(&packed.file)).unwrap();
        assert_eq!(set.len() as u64, packed.clouds);
        assert_eq!(set.smallest_cloud(), PACKED_POINTS as usize);
        let (classes, names) = (set.classes.as_ref().unwrap(), set.names.as_ref().unwrap());
        assert_eq!(classes[..], ["bowl", "chair", "cup"]);
        assert!(set.n_raw.as_ref().unwrap().iter().all(|&n| n >= MIN_POINTS));
        assert!(packed.left_out.iter().all(|scan| scan.points < MIN_POINTS.into()));
        for (name, &label) in names.iter().zip(&set.labels) {
            let class = &classes[label];
            assert!(name.starts_with(&format!("{class}/")), "{name}: {class}");
        }
        let names: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(names.len(), set.len(), "names are unique");
        for i in 0..set.len() {
            let largest = set.cloud(i).iter().map(|p| p[0].hypot(p[1]).hypot(p[2]));
            // The largest radius is 1 but for the rounding to f32, 2^-24.
            let largest = largest.fold(0.0, f32::max);
            assert!((largest - 1.0).abs() <= f32::EPSILON, "{largest}");
        }
    }
}

#[test]
fn finishing_again_gives_the_same_bytes_wherever_it_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let terms = terms(config(), None);
    let mut records = write(out, &terms, &entries());
    records.reverse();
    let again = || finish(DatasetFolder(out), &terms, records.clone(), failures());
    again().unwrap();
    let whole = files(out);

    // Stopped while it packed: no manifest yet, parts of files, a changed file.
    DatasetFolder(out).write_terms(&terms).unwrap();
    fs::remove_file(DatasetFolder(out).manifest_file()).unwrap();
    fs::write(out.join("packed/.edgepuck-abc.tmp"), "part").unwrap();
    fs::write(out.join("rotational/clean/cup/.edgepuck-abc.tmp"), "part").unwrap();
    fs::write(out.join("packed/rotational-clean-train.npz"), "other").unwrap();
    again().unwrap();
    assert!(files(out) == whole);

    // Stopped before the journal was removed.
    DatasetFolder(out).write_terms(&terms).unwrap();
    assert!(matches!(verify(out), Err(DatasetError::Unfinished { .. })));
    again().unwrap();
    assert!(files(out) == whole);

    // A scan is lost: an error, and no manifest of what is not there.
    DatasetFolder(out).write_terms(&terms).unwrap();
    let lost = out.join("static/clean/chair/train/chair_0_v0.npz");
    let bytes = fs::read(&lost).unwrap();
    fs::remove_file(&lost).unwrap();
    let message = again().map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("chair_0_v0.npz"), "{message}");
    assert!(!DatasetFolder(out).manifest_file().exists() && DatasetFolder(out).is_begun());
    fs::write(&lost, bytes).unwrap();
    again().unwrap();
    assert!(files(out) == whole);

    // The second time no mesh failed.
    finish(DatasetFolder(out), &terms, records.clone(), Vec::new()).unwrap();
    assert!(!DatasetFolder(out).failures_file().exists());
    assert!(verify(out).unwrap().is_sound());
}

#[test]
fn every_change_of_a_file_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    make(out);
    let problem = |file: &str, damage: &dyn Fn(&Path)| {
        let path = out.join(file);
        let before = fs::read(&path).ok();
        damage(&path);
        let report = verify(out).unwrap();
        match before {
            Some(bytes) => fs::write(&path, bytes).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        let [problem] = &report.problems[..] else { panic!("{file}: {:?}", report.problems) };
        assert_eq!(problem.path, Path::new(file));
        problem.what.clone()
    };
    let flip = |path: &Path| {
        let mut bytes = fs::read(path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(path, bytes).unwrap();
    };
    let remove = |path: &Path| fs::remove_file(path).unwrap();
    let add = |path: &Path| fs::write(path, "new").unwrap();
    let scan = "rotational/clean/chair/train/chair_0_v1";
    for (file, damage, said) in [
        (&format!("{scan}.npz")[..], &flip as &dyn Fn(&Path), "was changed: its SHA-256 is "),
        (&format!("{scan}.ply"), &flip, "was changed"),
        (&format!("{scan}.csv"), &remove, "is missing"),
        ("packed/static-noisy-test.npz", &remove, "is missing"),
        ("packed/static-noisy-train.npz", &flip, "was changed"),
        ("failures.jsonl", &flip, "does not list the manifest's failures"),
        ("failures.jsonl", &remove, "does not list the manifest's failures"),
        ("rotational/clean/chair/train/chair_9_v0.npz", &add, "is not in the manifest"),
        ("packed/.edgepuck-abc.tmp", &add, "is not in the manifest"),
    ] {
        let what = problem(file, damage);
        assert!(what.starts_with(said), "{file}: {what}");
    }
    assert!(verify(out).unwrap().is_sound());
}

#[test]
fn files_have_the_hash_of_the_settings() {
    for (hash, keys, said) in [
        (Hashing::Sha256, ["sha256"].as_slice(), Some("was changed: its SHA-256 is ")),
        (Hashing::None, &["hash"], None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        make_hashed(out, hash);
        let manifest = fs::read_to_string(DatasetFolder(out).manifest_file()).unwrap();
        for key in ["sha256", "hash"] {
            assert_eq!(manifest.contains(&format!("\"{key}\": ")), keys.contains(&key), "{key}");
        }
        // The text keeps its lines: only a hash finds the change.
        let path = out.join("rotational/clean/chair/train/chair_0_v1.csv");
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen('x', "y", 1)).unwrap();
        let report = verify(out).unwrap();
        let found: Vec<&str> = report.problems.iter().map(|problem| &problem.what[..]).collect();
        assert_eq!((report.hash, found.len()), (hash, usize::from(said.is_some())), "{found:?}");
        assert!(found.iter().zip(said).all(|(found, said)| found.starts_with(said)), "{found:?}");
    }
}

#[test]
fn manifests_that_are_missing_or_invalid_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    assert!(matches!(verify(out), Err(DatasetError::NoManifest { .. })));
    let manifest = make(out);
    let mut miscounting = manifest.clone();
    let points = &mut miscounting.meshes[0].scans[0].variants[0].tally.points;
    *points += 1;
    let expected = format!("holds {} points, not {} as recorded", *points - 1, points);
    DatasetFolder(out).close(&miscounting).unwrap();
    let problems = verify(out).unwrap().problems;
    assert!(problems.iter().all(|problem| problem.what == expected), "{problems:?}");
    assert_eq!(problems.len(), 4, "one for each format");

    let refused = |change: &dyn Fn(&mut Manifest)| {
        let mut changed = manifest.clone();
        change(&mut changed);
        DatasetFolder(out).close(&changed).unwrap();
        verify(out).unwrap_err().to_string()
    };
    let message = refused(&|manifest| manifest.tool = "other".to_owned());
    assert!(
        message.ends_with("expected a dataset of `edgepuck`, found one of `other`"),
        "{message}"
    );
    let message = refused(&|manifest| manifest.packed[0].hash = None);
    assert!(message.ends_with("expected the hash sha256 of every file, found none"), "{message}");
    for name in ["..", "a/b", "/etc", r"a\b", ""] {
        for message in [
            refused(&|manifest| manifest.meshes[0].entry.name = name.to_owned()),
            refused(&|manifest| manifest.config.sets[1].name = name.to_owned()),
        ] {
            assert!(message.contains("expected the name of a file or folder, found"), "{message}");
        }
    }
}

#[test]
fn every_builtin_sensor_comes_back_from_a_manifest() {
    let folder = tempfile::tempdir().unwrap();
    for name in Sensor::names() {
        let mut config = config();
        config.sets[0].sensor = Sensor::named(name).unwrap();
        let terms = terms(config, None);
        let manifest =
            finish(DatasetFolder(folder.path()), &terms, Vec::new(), Vec::new()).unwrap();
        let read = DatasetFolder(folder.path()).manifest().unwrap();
        assert_eq!(read, manifest, "{name}");
    }
    // Without meshes, the packed sets exist but are empty.
    assert!(verify(folder.path()).unwrap().is_sound());
    let set = read_labelled(&folder.path().join("packed/static-noisy-test.npz")).unwrap();
    assert!(set.is_empty());
}

#[test]
fn a_layout_that_cannot_hold_the_dataset_is_refused_before_the_run() {
    let mut config = config();
    config.layouts = vec![Layout::Webdataset];
    let message = config.check().unwrap_err().to_string();
    assert!(message.starts_with("layout webdataset: it "), "{message}");
}
