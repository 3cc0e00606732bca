//! The layers of PointNet, with hand-written gradients.
//!
//! # Rows with weights
//! The baseline's augmentation drops points by moving them onto the first point of the cloud. Such
//! duplicates do not change a maximum, but they count in the mean and the variance of a batch norm.
//! Here, dropped points are removed, and the weight of the first point's row is the number of its
//! duplicates. The forward pass gives the same statistics and outputs. In the backward pass, the
//! gradient of the row is the sum of the gradients of its duplicates, so that the share of the
//! batch norm counts once for each duplicate. On average, this saves seven sixteenths of the work,
//! and it changes results only by rounding.

mod edge;
mod hidden;
mod linear;
mod neighbor_pool;
mod norm;
mod normed;
mod pooled;
mod transform;

pub use edge::EdgeLayer;
pub use hidden::HiddenLayer;
pub use linear::Linear;
pub use neighbor_pool::{Centres, NeighborPool};
pub use norm::{EPSILON, Norm};
pub use normed::Normed;
pub use pooled::PooledLayer;
pub use transform::{Transforms, orthogonality};

use crate::matrix::Matrix;
use crate::parameter::Parameter;

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

/// A layer of a network, with its state.
#[derive(Debug)]
pub struct LayerMut<'a> {
    /// The linear layer.
    pub linear: &'a mut Linear,
    /// The batch norm of the linear layer's output, if there is one.
    pub norm: Option<&'a mut Norm>,
    /// The last output after the batch norm.
    pub output: Option<&'a Matrix>,
}

/// A part of a network, which owns layers.
pub trait Module {
    /// The layers in the order of the forward pass.
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

    /// All linear layers, with their batch norms folded in.
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
