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

/// Points in a fixed order; a cloud of n is the first n of them.
pub struct Cloud(Vec<[f32; 3]>);

impl Cloud {
    /// `n` points.
    pub fn new(n: usize) -> Self {
        let stream = StreamKey::new(SEED, "bench infer", 0);
        let point = |i: u64| {
            let angle = |k| TAU * stream.unit(2 * i + k);
            let (around, along) = (angle(0), angle(1));
            let radius_m = RADII_M[0] + RADII_M[1] * along.cos();
            let x = [radius_m * around.cos(), radius_m * around.sin(), RADII_M[1] * along.sin()];
            x.map(|x| x as f32)
        };
        Self((0..n as u64).map(point).collect())
    }

    /// The first `n` points.
    pub fn first(&self, n: usize) -> &[[f32; 3]] {
        &self.0[..n]
    }

    /// All points.
    pub fn points(&self) -> Vec<[f32; 3]> {
        self.0.clone()
    }

    /// Writes the cloud for other programs, as tensor `points`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, file: &Path) -> Result<()> {
        let points = Tensor { shape: vec![self.0.len(), 3], values: self.0.concat() };
        let tensors = BTreeMap::from([("points".to_owned(), points)]);
        Ok(write_weights(file, &tensors, &BTreeMap::new())?)
    }
}
