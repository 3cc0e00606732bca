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
mod norm;
mod pooled;

pub use edge::EdgeLayer;
pub use hidden::HiddenLayer;
pub use linear::Linear;
pub use norm::Norm;
pub use pooled::PooledLayer;

use ndarray::ArrayView2;

use crate::matrix::Matrix;
use crate::parameter::Parameter;

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

/// A linear layer, its batch norm, and the last output: the base of every layer before a ReLU or a
/// pooling.
#[derive(Clone, Debug)]
pub struct Normed {
    /// `W x + b`.
    pub linear: Linear,
    /// The batch norm of its output.
    pub norm: Norm,
    /// The last output.
    pub output: Matrix,
}

impl Normed {
    /// A layer with random weights, whose parts are named `linear` and `norm`.
    pub fn new(linear: &str, norm: &str, (inputs, outputs): (usize, usize), seed: u64) -> Self {
        Self {
            linear: Linear::new(linear, inputs, outputs, seed),
            norm: Norm::new(norm, outputs),
            output: Matrix::default((0, outputs)),
        }
    }

    /// The output of the last forward pass.
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.output.view()
    }

    /// The layer as a part of a network.
    pub fn layer(&mut self) -> LayerMut<'_> {
        let Self { linear, norm, output } = self;
        LayerMut { linear, norm: Some(norm), output: Some(output) }
    }
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

    /// The name of the first layer whose last output is not finite.
    fn not_finite(&mut self) -> Option<&str> {
        let is_broken = |layer: &LayerMut<'_>| {
            layer.output.is_some_and(|output| !output.iter().all(|x| x.is_finite()))
        };
        self.layers().into_iter().find(is_broken).map(|layer| layer.linear.name())
    }
}
