//! The one cloud that all engines are given parts of.

use anyhow::Result;
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use ndarray::{Array2, ArrayView2, s};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

const SEED: u64 = 3;

/// Radii of the torus that the points lie on; the larger sum is 1, as that of
/// a normalised cloud.
const RADII_M: [f64; 2] = [0.7, 0.3];

/// Points in a fixed order; a cloud of n is the first n of them.
pub struct Cloud(Array2<f32>);

impl Cloud {
    /// `n` points.
    pub fn new(n: usize) -> Self {
        let stream = StreamKey::new(SEED, "bench infer", 0);
        let mut points = Array2::zeros((n, 3));
        for (i, mut point) in points.rows_mut().into_iter().enumerate() {
            let angle = |k| TAU * stream.unit(2 * i as u64 + k);
            let (around, along) = (angle(0), angle(1));
            let radius_m = RADII_M[0] + RADII_M[1] * along.cos();
            let x = [radius_m * around.cos(), radius_m * around.sin(), RADII_M[1] * along.sin()];
            point.assign(&ndarray::aview1(&x.map(|x| x as f32)));
        }
        Self(points)
    }

    /// The first `n` points, `[n, 3]`.
    pub fn first(&self, n: usize) -> ArrayView2<'_, f32> {
        self.0.slice(s![..n, ..])
    }

    /// All points.
    pub fn points(&self) -> Vec<[f32; 3]> {
        self.0.rows().into_iter().map(|point| [point[0], point[1], point[2]]).collect()
    }

    /// Writes the cloud for other programs, as tensor `points`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, file: &Path) -> Result<()> {
        let values = self.0.iter().copied().collect();
        let points = Tensor { shape: self.0.shape().to_vec(), values };
        let tensors = BTreeMap::from([("points".to_owned(), points)]);
        Ok(write_weights(file, &tensors, &BTreeMap::new())?)
    }
}
