//! A linear layer and its batch norm: the base of every layer before a ReLU or a pooling.

use ndarray::ArrayView2;

use super::{LayerMut, Linear, Norm};
use crate::matrix::Matrix;

/// A linear layer, its batch norm, and the last output.
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
    #[must_use]
    pub fn new(linear: &str, norm: &str, (inputs, outputs): (usize, usize), seed: u64) -> Self {
        Self {
            linear: Linear::new(linear, inputs, outputs, seed),
            norm: Norm::new(norm, outputs),
            output: Matrix::default((0, outputs)),
        }
    }

    /// The output of the last forward pass.
    #[must_use]
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.output.view()
    }

    /// The layer as a part of a network.
    pub fn layer(&mut self) -> LayerMut<'_> {
        let Self { linear, norm, output } = self;
        LayerMut { linear, norm: Some(norm), output: Some(output) }
    }
}
