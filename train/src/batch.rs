//! A batch of clouds, and the rows of its points.

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use crate::matrix::Matrix;

/// Clouds and their targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Points of all clouds, `[rows, 3]`, each once.
    pub coordinates: Vec<[f32; 3]>,
    /// The weight of each point in statistics.
    pub weights: Vec<f32>,
    /// The first row of each cloud, and the end of the last cloud.
    pub starts: Vec<usize>,
    /// All points of each cloud, among which EdgeConv layers search for neighbors. Empty if the
    /// network has no such layer.
    pub neighborhoods: Vec<Vec<[f32; 3]>>,
    /// The target share of each class, `[clouds, classes]`.
    pub targets: Matrix,
}

impl Batch {
    /// The number of clouds.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The points as a matrix.
    pub fn points(&self) -> ArrayView2<'_, f32> {
        let flat = self.coordinates.as_flattened();
        ArrayView2::from_shape((self.coordinates.len(), 3), flat)
            .expect("invariant: three coordinates a point")
    }

    /// The rows of the points, with their weights.
    pub fn rows(&self) -> Rows<'_> {
        Rows::new(&self.weights, &self.starts)
    }
}

/// The points of a batch, with weights.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The weight of each row in statistics.
    pub weights: &'a [f32],
    /// The first row of each cloud, and the end of the last cloud.
    pub starts: &'a [usize],
    /// The sum of all weights.
    pub total: f32,
}

impl<'a> Rows<'a> {
    /// Rows of these weights, in clouds that begin at `starts`.
    pub fn new(weights: &'a [f32], starts: &'a [usize]) -> Self {
        let total = weights.iter().map(|&w| f64::from(w)).sum::<f64>() as f32;
        Self { weights, starts, total }
    }

    /// The number of clouds.
    pub fn n_clouds(&self) -> usize {
        self.starts.len() - 1
    }
}

pub(crate) fn by_cloud<'a>(matrix: &'a mut Matrix, rows: Rows<'_>) -> Vec<ArrayViewMut2<'a, f32>> {
    let mut clouds = Vec::with_capacity(rows.n_clouds());
    let mut rest = matrix.view_mut();
    for pair in rows.starts.windows(2) {
        let (cloud, after) = rest.split_at(Axis(0), pair[1] - pair[0]);
        clouds.push(cloud);
        rest = after;
    }
    clouds
}
