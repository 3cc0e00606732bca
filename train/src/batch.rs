//! A batch of clouds.

use ndarray::ArrayView2;

use crate::matrix::Matrix;
use crate::rows::Rows;

/// Clouds and their targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Points of all clouds, `[rows, 3]`, each once.
    pub coordinates: Vec<[f32; 3]>,
    /// The weight of each point in statistics.
    pub weights: Vec<f32>,
    /// The first row of each cloud, and the end of the last cloud.
    pub starts: Vec<usize>,
    /// All points of the clouds, among which EdgeConv layers search for neighbors. Empty if the
    /// network has no such layer.
    pub neighborhood: Vec<[f32; 3]>,
    /// The index in `neighborhood` of each cloud's first point, and the end of the last cloud.
    pub neighborhood_starts: Vec<usize>,
    /// The target share of each class, `[clouds, classes]`.
    pub targets: Matrix,
}

impl Batch {
    /// The number of clouds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether the batch has no cloud.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points among which cloud `cloud` searches for neighbors.
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
