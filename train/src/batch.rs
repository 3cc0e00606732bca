//! A batch of clouds.

use ndarray::ArrayView2;

use crate::layer::Rows;
use crate::matrix::Matrix;

/// Clouds and their targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Points of all clouds, `[rows, 3]`, each once.
    pub coordinates: Vec<[f32; 3]>,
    /// How often each point counts in statistics.
    pub weights: Vec<f32>,
    /// Where each cloud's rows begin, and where the last cloud's end.
    pub starts: Vec<usize>,
    /// All points of the clouds, in which EdgeConv layers search neighbors; empty
    /// without such layers.
    pub neighborhood: Vec<[f32; 3]>,
    /// Where each cloud's points begin in `neighborhood`, and where the last
    /// cloud's end.
    pub neighborhood_starts: Vec<usize>,
    /// The target share of each class, `[clouds, classes]`.
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

    /// The points among which cloud `cloud` searches neighbors.
    #[must_use]
    pub fn neighborhood_of(&self, cloud: usize) -> &[[f32; 3]] {
        match self.neighborhood_starts.get(cloud..cloud + 2) {
            Some(&[first, last]) => &self.neighborhood[first..last],
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

    /// The rows of the points, with their weights.
    #[must_use]
    pub fn rows(&self) -> Rows<'_> {
        Rows::new(&self.weights, &self.starts)
    }
}
