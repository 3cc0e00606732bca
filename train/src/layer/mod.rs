//! The layers of PointNet, with hand-written gradients.
//!
//! # Rows with weights
//! The baseline's augmentation drops points by moving them onto the cloud's
//! first point. A maximum ignores such duplicates; only batch norms count them, in
//! mean and variance. Therefore dropped points are removed here, and the first
//! point's row has the weight of all its duplicates. In the forward pass, every
//! layer's statistics and outputs are the same. In the backward pass, a duplicate's
//! gradient is that of its original: the row's gradient is their sum, in which the
//! batch norm's share counts once for each. This saves seven sixteenths of the work
//! on average and changes results only by rounding.

mod edge;
mod linear;
mod norm;
mod normed;
mod point;
mod pooled;
mod transform;
mod vector;

pub use edge::EdgeLayer;
pub use linear::Linear;
pub use norm::Norm;
pub use normed::Normed;
pub use point::PointLayer;
pub use pooled::PooledLayer;
pub use transform::{Transforms, orthogonality};
pub use vector::VectorLayer;

use ndarray::{ArrayViewMut2, Axis};

use crate::matrix::Matrix;
use crate::parameter::Parameter;

/// The points of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// How often each row counts in statistics.
    pub weights: &'a [f32],
    /// Where each cloud's rows begin, and where the last cloud's end.
    pub starts: &'a [usize],
    /// The sum of all weights.
    pub total: f32,
}

impl Rows<'_> {
    /// How many clouds there are.
    #[must_use]
    pub fn n_clouds(&self) -> usize {
        self.starts.len() - 1
    }
}

/// The rows of each cloud.
fn by_cloud<'a>(matrix: &'a mut Matrix, rows: Rows<'_>) -> Vec<ArrayViewMut2<'a, f32>> {
    let mut clouds = Vec::with_capacity(rows.n_clouds());
    let mut rest = matrix.view_mut();
    for pair in rows.starts.windows(2) {
        let (cloud, after) = rest.split_at(Axis(0), pair[1] - pair[0]);
        clouds.push(cloud);
        rest = after;
    }
    clouds
}

/// A linear layer with its batch norm folded in, for a model file.
#[derive(Clone, Debug, PartialEq)]
pub struct Folded {
    /// The linear layer's name.
    pub name: String,
    /// `[outputs, inputs]`.
    pub shape: [usize; 2],
    /// W.
    pub weight: Vec<f32>,
    /// b.
    pub bias: Vec<f32>,
}

/// A part of a network: it owns parameters and running statistics.
pub trait Module {
    /// Calls `visit` with each parameter, always in the same order.
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter));

    /// Calls `visit` with the name and values of each running statistic.
    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>));

    /// Calls `visit` with each linear layer, with its batch norm folded in.
    fn folded(&self, visit: &mut dyn FnMut(Folded));
}
