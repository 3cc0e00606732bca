//! The protocol on boxes that take no time.

use super::folds::Folds;
use super::{SydneyArgs, run};
use formats::model_card::{ModelCard, Normalization};
use formats::rng::StreamKey;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use test_support::{need, shared_data};
use train::model_file;
use train::recipe::Recipe;
use train::trainer::Trainer;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Edges of the boxes of each class, metres.
const BOXES: [(&str, [f32; 3]); 3] =
    [("4wd", [4.5, 1.8, 1.8]), ("pedestrian", [0.5, 0.5, 1.7]), ("pole", [0.1, 0.1, 4.0])];
const POINTS: usize = 40;

const RECIPE: &str = r#"
points = 32
batch = 10
epochs = 4
clouds_per_epoch = 100
sampling = "random"
normalization = "metric"
validation = 0.0
[network]
input_transform = false
feature_transform = false
trunk = [8, 16]
head = [8]
[augment]
drop = 0.0
shift = 0.0
"#;

/// An array as NumPy writes it.
fn array(zip: &mut ZipWriter<File>, key: &str, descr: &str, shape: &str, data: &[u8]) {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    zip.start_file(format!("{key}.npy"), SimpleFileOptions::default()).unwrap();
    zip.write_all(&[b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), data].concat()).unwrap();
}

/// Writes 30 boxes in turns to `folds`, without the arrays of the names `without`.
fn write(path: &Path, folds: [u8; 2], without: &[&str]) {
    let mut zip = ZipWriter::new(File::create(path).unwrap());
    let key = StreamKey::new(3, "boxes", u32::from(folds[0]));
    let m = 30;
    let coordinate = |i: usize| {
        let (object, axis) = (i / (3 * POINTS), i % 3);
        [5.0, 1.0, -1.7][axis] + BOXES[object % 3].1[axis] * key.unit(i as u64) as f32
    };
    let points: Vec<u8> = (0..3 * POINTS * m).flat_map(|i| coordinate(i).to_le_bytes()).collect();
    let offsets: Vec<u8> = (0..=m).flat_map(|i| ((i * POINTS) as i64).to_le_bytes()).collect();
    let labels: Vec<u8> =
        (0..m).flat_map(|i| format!("{:\0<10}", BOXES[i % 3].0).into_bytes()).collect();
    let fold: Vec<u8> = (0..m).map(|i| folds[i / 3 % 2]).collect();
    array(&mut zip, "points", "<f4", &format!("({}, 3)", POINTS * m), &points);
    for (key, descr, n, data) in [
        ("offsets", "<i8", m + 1, &offsets),
        ("labels", "|S10", m, &labels),
        ("raw_labels", "|S10", m, &labels),
        ("fold", "|u1", m, &fold),
    ] {
        if !without.contains(&key) {
            array(&mut zip, key, descr, &format!("({n},)"), data);
        }
    }
    zip.finish().unwrap();
}

/// What the command is asked to do with files of `folder`.
fn args(folder: &Path, folds: &[&str]) -> SydneyArgs {
    let at = |name: &str| folder.join(name);
    SydneyArgs {
        folds: folds.iter().map(|name| at(name)).collect(),
        init: Some(at("init.safetensors")),
        recipe: Some(at("recipe.toml")),
        seeds: 2,
        votes: 3,
        out: at("out"),
        report: Some(at("report.md")),
    }
}

/// A folder with a recipe, a model to start from, and two files of two folds each.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { folder.path().join(name) };
    std::fs::write(at("recipe.toml"), RECIPE).unwrap();
    let mut trainer = Trainer::new(toml::from_str::<Recipe>(RECIPE).unwrap(), 2).unwrap();
    let classes = ["car", "person"].map(str::to_owned).to_vec();
    let normalization = Normalization::Metric;
    let card = ModelCard { classes, normalization, points: Some(32), ..ModelCard::default() };
    model_file::ship(&at("init.safetensors"), &mut trainer.model, &card).unwrap();
    write(&at("a.npz"), [0, 1], &[]);
    write(&at("b.npz"), [2, 3], &[]);
    folder
}

#[test]
fn each_fold_is_tested_by_networks_of_the_others() {
    let folder = folder();
    let args = args(folder.path(), &["a.npz", "b.npz"]);
    let [learnt, tested] = Folds::read(&args.folds).unwrap().split(2);
    assert_eq!((learnt.len(), tested.len()), (45, 15));
    run(&args).unwrap();
    let report = std::fs::read(args.report.as_ref().unwrap()).unwrap();
    let text = String::from_utf8(report.clone()).unwrap();
    assert!(text.contains("| start | seed | fold 0 | fold 1 | fold 2 | fold 3 | mean |"), "{text}");
    for line in ["| pre-trained | 1 | ", "| from scratch | 0 | ", "| 4wd | 20 | "] {
        assert!(text.contains(line), "{line}: {text}");
    }
    // The networks are there; the same again only tests them.
    run(&args).unwrap();
    assert!(std::fs::read(args.report.as_ref().unwrap()).unwrap() == report);
    write(&args.folds[1], [2, 5], &[]);
    let error = format!("{:#}", run(&args).unwrap_err());
    assert!(error.contains("terms.toml: an earlier run had another plan"), "{error}");
}

#[test]
fn files_that_are_no_folds_are_refused_by_file_and_array() {
    let folder = folder();
    for (name, folds, without, expected) in [
        ("f.npz", [0, 1], &["fold"][..], "f.npz: fold: expected one for each cloud, found none"),
        ("r.npz", [0, 1], &["raw_labels"], "r.npz: raw_labels: expected one for each cloud"),
        ("o.npz", [4, 4], &[], "fold: expected two folds or more in all files together, found 1"),
        ("l.npz", [0, 1], &["labels"], "l.npz: labels: missing"),
    ] {
        write(&folder.path().join(name), folds, without);
        let error = format!("{:#}", run(&args(folder.path(), &[name])).unwrap_err());
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn the_benchmark_s_own_folds_are_read() {
    let file = need!(shared_data("real_objects/sydney_folds01.npz"));
    let folds = Folds::read(&[file]).unwrap();
    assert_eq!((folds.clouds.len(), folds.clouds.classes.len()), (297, 14));
    assert_eq!(folds.numbers(), [0, 1]);
}
