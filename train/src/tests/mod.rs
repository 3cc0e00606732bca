//! Training, compared with plain twins and with infer-cpu.

mod augment;
mod clusters;
mod export;
mod gradients;
mod init;
mod reference;
mod resume;

use std::path::Path;

use crate::clouds::Clouds;
use crate::recipe::Recipe;
use formats::labelled::{LabelledSet, equal_offsets};
use formats::rng::StreamKey;
use infer_cpu::{Classifier, Options};

fn recipe(text: &str) -> Recipe {
    toml::from_str(text).unwrap()
}

fn clouds(n: usize) -> Clouds {
    clouds_of(5, n)
}

/// `n` clouds of 32 points in three classes: a ball, a disc, a rod.
fn clouds_of(seed: u64, n: usize) -> Clouds {
    let mut points = Vec::new();
    for cloud in 0..n {
        let key = StreamKey::new(seed, "clouds", cloud as u32);
        for point in 0..32 {
            let unit = |axis| (2.0 * key.unit(3 * point + axis) - 1.0) as f32;
            let flat = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.05], [1.0, 0.05, 0.05]][cloud % 3];
            points.extend([0, 1, 2].map(|axis| unit(axis as u64) * flat[axis]));
        }
    }
    let set = LabelledSet {
        points,
        offsets: equal_offsets(n, 32),
        labels: (0..n).map(|cloud| cloud % 3).collect(),
        ..LabelledSet::default()
    };
    Clouds { set, classes: ["ball", "disc", "rod"].map(str::to_owned).to_vec() }
}

/// The logits that infer-cpu computes with the model at `path`.
fn logits(path: &Path, clouds: &Clouds) -> Vec<Vec<f32>> {
    let mut classifier = Classifier::load(path, &Options::default()).unwrap();
    let clouds = (0..clouds.len()).map(|i| clouds.set.cloud(i));
    clouds.map(|points| classifier.classify(points).unwrap().logits.clone()).collect()
}

/// The largest magnitude of `values`, or 1.
fn largest(values: &[f32]) -> f32 {
    values.iter().fold(1.0, |most, x| most.max(x.abs()))
}

/// Checks that each value is within `tolerance` of the expected one, by which it is given.
fn assert_near(found: &[f32], expected: &[f32], tolerance: impl Fn(f32) -> f32) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance(*expected), "{found} for {expected}");
    }
}
