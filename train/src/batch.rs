//! Clouds as a network learns from them.

use ndarray::ArrayView2;

use crate::layer::Rows;
use crate::matrix::Matrix;

/// Some clouds and what they should be called.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Points of all clouds, `[rows, 3]`, distinct ones only.
    pub coordinates: Vec<[f32; 3]>,
    /// How often each counts.
    pub weights: Vec<f32>,
    /// Where each cloud's rows begin, and where the last one's end.
    pub starts: Vec<usize>,
    /// All points of the clouds, where the network looks around those above;
    /// else nothing.
    pub around: Vec<[f32; 3]>,
    /// Where each cloud's begin in `around`, and where the last one's end.
    pub around_starts: Vec<usize>,
    /// The share of each class, `[clouds, classes]`.
    pub targets: Matrix,
}

impl Batch {
    /// How many clouds there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All points of cloud `cloud`.
    #[must_use]
    pub fn surroundings(&self, cloud: usize) -> &[[f32; 3]] {
        match self.around_starts.get(cloud..cloud + 2) {
            Some(&[first, last]) => &self.around[first..last],
            _ => &[],
        }
    }

    /// The points as a matrix.
    #[must_use]
    pub fn points(&self) -> ArrayView2<'_, f32> {
        let flat = self.coordinates.as_flattened();
        ArrayView2::from_shape((self.coordinates.len(), 3), flat)
            .expect("invariant: three coordinates a point")
    }

    /// Their rows.
    #[must_use]
    pub fn rows(&self) -> Rows<'_> {
        let total = self.weights.iter().map(|&w| f64::from(w)).sum::<f64>() as f32;
        Rows { weights: &self.weights, starts: &self.starts, total }
    }
}
