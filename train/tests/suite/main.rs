//! Training, held to plain twins and to what users do with it.

#![expect(clippy::unwrap_used, reason = "tests")]

mod augment;
mod clusters;
mod export;
mod gradients;
mod init;
mod reference;
mod resume;
mod robust;

use formats::labelled::{LabelledSet, equal_offsets};
use formats::rng::StreamKey;
use train::clouds::Clouds;
use train::recipe::Recipe;

fn recipe(text: &str) -> Recipe {
    toml::from_str(text).unwrap()
}

/// `n` clouds of 32 points in three classes: a ball, a disc, a rod.
fn clouds(n: usize) -> Clouds {
    clouds_of(5, n)
}

fn test_clouds(n: usize) -> Clouds {
    clouds_of(6, n)
}

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
