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
mod hidden;
mod linear;
mod norm;
mod normed;
mod pooled;
mod transform;

pub use edge::EdgeLayer;
pub use hidden::HiddenLayer;
pub use linear::Linear;
pub use norm::{EPSILON, Norm};
pub use normed::Normed;
pub use pooled::PooledLayer;
pub use transform::{Transforms, orthogonality};

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

impl<'a> Rows<'a> {
    /// Rows of these weights, in clouds that begin at `starts`.
    #[must_use]
    pub fn new(weights: &'a [f32], starts: &'a [usize]) -> Self {
        let total = weights.iter().map(|&w| f64::from(w)).sum::<f64>() as f32;
        Self { weights, starts, total }
    }

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

/// A layer of a network, with everything that it keeps between steps.
#[derive(Debug)]
pub struct LayerMut<'a> {
    /// The linear layer.
    pub linear: &'a mut Linear,
    /// The batch norm of its output, if there is one.
    pub norm: Option<&'a mut Norm>,
    /// The last output behind that norm.
    pub output: Option<&'a Matrix>,
}

/// A part of a network: it owns layers.
pub trait Module {
    /// The layers, always in the same order: that of the forward pass.
    fn layers(&mut self) -> Vec<LayerMut<'_>>;

    /// The parameters of all layers.
    fn parameters(&mut self) -> Vec<&mut Parameter> {
        let mut parameters = Vec::new();
        for LayerMut { linear, norm, .. } in self.layers() {
            parameters.extend([&mut linear.weight, &mut linear.bias]);
            parameters.extend(norm.into_iter().flat_map(|norm| [&mut norm.scale, &mut norm.shift]));
        }
        parameters
    }

    /// The running statistics of all batch norms, with their names.
    fn statistics(&mut self) -> Vec<(String, &mut Vec<f32>)> {
        let norms = self.layers().into_iter().filter_map(|layer| layer.norm);
        norms.flat_map(Norm::statistics).collect()
    }

    /// Every linear layer, with its batch norm folded in.
    fn folded(&mut self) -> Vec<Folded> {
        let fold = |layer: LayerMut<'_>| match layer.norm {
            Some(norm) => norm.folded_into(layer.linear),
            None => layer.linear.folded(),
        };
        self.layers().into_iter().map(fold).collect()
    }

    /// The name of the first layer whose last output is not finite.
    fn not_finite(&mut self) -> Option<&str> {
        let is_broken = |layer: &LayerMut<'_>| {
            layer.output.is_some_and(|output| !output.iter().all(|x| x.is_finite()))
        };
        self.layers().into_iter().find(is_broken).map(|layer| layer.linear.name())
    }
}
