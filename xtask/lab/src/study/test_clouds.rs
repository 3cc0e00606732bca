//! Clouds that are told apart in no time, for tests of studies.

use formats::hash::Hashing;
use formats::packed::PackedWriter;
use formats::rng::StreamKey;
use std::path::Path;

/// Points of a cloud.
pub const POINTS: usize = 32;

/// Writes a packed set to `path`: clouds `first` to `n` of a ball, a disc and a
/// rod in turns, called `m0_v0`, `m1_v0` and so on. Another seed gives other
/// clouds of the same classes.
pub fn write(path: &Path, seed: u64, first: usize, n: usize) {
    let classes = ["ball", "disc", "rod"].map(str::to_owned).to_vec();
    let mut packed = PackedWriter::create(path, POINTS, classes).unwrap();
    for i in first..n {
        let n_raw = 10 + 5 * i as u32;
        packed.push(&cloud(seed, i), i % 3, &format!("m{i}_v0"), n_raw).unwrap();
    }
    packed.finish(Hashing::None).unwrap();
}

fn cloud(seed: u64, i: usize) -> Vec<[f32; 3]> {
    let key = StreamKey::new(seed, "clouds", i as u32);
    let flat = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.05], [1.0, 0.05, 0.05]][i % 3];
    let unit = |n: usize| (2.0 * key.unit(n as u64) - 1.0) as f32;
    (0..POINTS).map(|point| [0, 1, 2].map(|axis| unit(3 * point + axis) * flat[axis])).collect()
}
