//! Networks of clusters, trained and evaluated by the program.

use super::{stderr, train};
use formats::model_card::{ModelCard, Normalization};
use formats::packed::{ClusterWriter, Remarks};
use formats::rng::StreamKey;
use infer_cpu::{Classifier, Options};
use std::path::Path;

/// Edges of boxes of each class, metres.
const BOXES: [(&str, [f64; 3]); 3] =
    [("car", [4.5, 1.8, 1.5]), ("person", [0.5, 0.5, 1.75]), ("wall", [9.0, 0.2, 3.0])];

/// Points in a box some metres from the sensor.
fn cluster(class: usize, n: usize, key: StreamKey) -> Vec<[f32; 3]> {
    let centre = [5.0 + 20.0 * key.unit(0), 10.0 * key.unit(1), -1.7];
    let point = |i: usize| {
        let unit = |axis: usize| key.unit((2 + 3 * i + axis) as u64);
        [0, 1, 2].map(|axis| (centre[axis] + BOXES[class].1[axis] * unit(axis)) as f32)
    };
    (0..n).map(point).collect()
}

/// A set of `n` clusters of each class, of 10 to 90 points.
fn write(path: &Path, n: usize, seed: u64) {
    let classes = BOXES.map(|(name, _)| name.to_owned()).to_vec();
    let mut writer = ClusterWriter::create(path, classes).unwrap();
    for i in 0..3 * n {
        let key = StreamKey::new(seed, "cluster", i as u32);
        let points = cluster(i % 3, 10 + key.below(81, 0) as usize, key);
        let remarks = Remarks {
            name: &format!("{}_{i}_v0", BOXES[i % 3].0),
            id: &format!("{i}#0"),
            sensor: if i % 2 == 0 { "vlp32c" } else { "hdl64e" },
            range_m: 3.0 + 0.1 * i as f32,
            truth_share: 1.0,
            height_m: f32::NAN,
        };
        writer.push(&points, i % 3, &remarks).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_network_of_clusters_is_trained_and_answers_unknown() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("train.npz"), 240, 1);
    write(&folder.path().join("test.npz"), 30, 2);
    let recipe = "points = 48\nbatch = 20\nepochs = 20\nsampling = \"random\"\n\
        normalization = \"metric\"\nbalance = 1.0\nclouds_per_epoch = 200\n\
        unknown = [\"wall\"]\n\
        [network]\ntrunk = [16, 32]\nhead = [16]\n\
        [augment]\ndrop = 0.0\nscale = [0.9, 1.1]\nshift = 0.0\nrotate_degrees = 180.0\n\
        [clusters]\ndensity = [8, 64]\ncut = 0.1\n";
    std::fs::write(folder.path().join("r.toml"), recipe).unwrap();
    let ran = train(folder.path(), "train --data . --recipe r.toml --out m.safetensors");
    assert!(ran.status.success(), "{}", stderr(&ran));
    let path = folder.path().join("m.safetensors");
    let card = ModelCard::read(&path).unwrap();
    assert_eq!(card.normalization, Normalization::Metric);
    assert_eq!(card.unknown_classes, ["wall"]);
    assert!(card.temperature != 1.0);
    let mut classifier = Classifier::load(&path, &Options::default()).unwrap();
    let answers: Vec<String> = (0..3)
        .map(|class| {
            let points = cluster(class, 80, StreamKey::new(9, "cluster", class as u32));
            classifier.classify(&points).unwrap().answer().to_owned()
        })
        .collect();
    assert_eq!(answers, ["car", "person", "unknown"]);

    let words = "eval --model m.safetensors --data test.npz --csv t.csv --min-points 8";
    let ran = train(folder.path(), words);
    let text = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(ran.status.success(), "{}", stderr(&ran));
    for expected in ["negatives  all", "car        hdl64e", "mean over classes"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let csv = std::fs::read_to_string(folder.path().join("t.csv")).unwrap();
    assert!(csv.starts_with("class,group,hits,of,share,low,high\ncar,all,"), "{csv}");
    let unsuited = "warning: edge-64: expected a model of clusters in metres";
    assert!(!stderr(&ran).contains("expected a model of clusters"), "{}", stderr(&ran));
    let of_wholes = train(folder.path(), "eval --model edge-64 --data test.npz");
    assert!(of_wholes.status.success() && stderr(&of_wholes).contains(unsuited));
    for (words, code, cause) in [
        ("--known plane", 2, "--known: expected some of car, person, wall, found plane"),
        ("--min-points 100000", 1, "expected objects, found none of --min-points 100000 or more"),
        ("--data test.npz", 2, "--data: expected each file once, found test.npz twice"),
    ] {
        let words = format!("eval --model m.safetensors --data test.npz {words}");
        let ran = train(folder.path(), &words);
        assert!(stderr(&ran).contains(cause), "{words}: {}", stderr(&ran));
        assert_eq!(ran.status.code(), Some(code), "{words}");
    }
}

#[test]
fn an_unknown_class_that_the_data_lack_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("train.npz"), 20, 1);
    let recipe = "normalization = \"metric\"\nbatch = 10\nunknown = [\"tree\"]\n";
    std::fs::write(folder.path().join("r.toml"), recipe).unwrap();
    let ran = train(folder.path(), "train --data train.npz --recipe r.toml --out m.safetensors");
    let error = stderr(&ran);
    assert!(error.contains("unknown: expected some of the classes") && error.contains("`tree`"));
}
