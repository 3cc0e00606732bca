//! The one cloud that all engines are given parts of.

use anyhow::Result;
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

const SEED: u64 = 3;

/// Radii of the torus that the points lie on; the larger sum is 1, as that of
/// a normalised cloud.
const RADII_M: [f64; 2] = [0.7, 0.3];

/// `n` points in a fixed order; a cloud of fewer is the first of them.
pub fn cloud(n: usize) -> Vec<[f32; 3]> {
    let stream = StreamKey::new(SEED, "bench infer", 0);
    let point = |i: u64| {
        let angle = |k| TAU * stream.unit(2 * i + k);
        let (around, along) = (angle(0), angle(1));
        let radius_m = RADII_M[0] + RADII_M[1] * along.cos();
        let x = [radius_m * around.cos(), radius_m * around.sin(), RADII_M[1] * along.sin()];
        x.map(|x| x as f32)
    };
    (0..n as u64).map(point).collect()
}

/// Writes `cloud` for other programs, as tensor `points`.
pub fn write(cloud: &[[f32; 3]], file: &Path) -> Result<()> {
    let points = Tensor { shape: vec![cloud.len(), 3], values: cloud.concat() };
    let tensors = BTreeMap::from([("points".to_owned(), points)]);
    Ok(write_weights(file, &tensors, &BTreeMap::new())?)
}
