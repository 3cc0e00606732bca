//! The rows of a batch: the points of all of its clouds.

use ndarray::{ArrayViewMut2, Axis};

use crate::matrix::Matrix;

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
    #[must_use]
    pub fn new(weights: &'a [f32], starts: &'a [usize]) -> Self {
        let total = weights.iter().map(|&w| f64::from(w)).sum::<f64>() as f32;
        Self { weights, starts, total }
    }

    /// The number of clouds.
    #[must_use]
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
