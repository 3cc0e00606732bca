//! A point-wise layer: linear, batch norm, ReLU.

use ndarray::ArrayView2;

use super::norm::Saved;
use super::{Normed, Rows};
use crate::matrix::{self, Matrix};

/// A layer that is applied to each point alone.
#[derive(Clone, Debug)]
pub struct PointLayer {
    /// Its parameters and its last output.
    pub base: Normed,
    saved: Saved,
}

impl PointLayer {
    /// A layer whose parts are named `linear` and `norm`.
    #[must_use]
    pub fn new(linear: &str, norm: &str, size: (usize, usize), seed: u64) -> Self {
        Self { base: Normed::new(linear, norm, size, seed), saved: Saved::default() }
    }

    /// Takes `x` `[rows, inputs]` through the layer.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        let z = self.base.linear.products(x);
        let bias = &self.base.linear.bias.value;
        (self.base.output, self.saved) =
            self.base.norm.forward(z, (rows.weights, rows.total), bias, (momentum, true));
    }

    /// Sets the parameters' gradients from that of the output; returns that of the
    /// product, for [`PointLayer::input_gradient`].
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dy: Matrix, rows: Rows<'_>) -> Matrix {
        let weights = (rows.weights, rows.total);
        let dz = self.base.norm.backward(dy, Some(&self.base.output), &self.saved, weights);
        self.base.linear.backward_products(x, dz.view());
        dz
    }

    /// The gradient of the inputs.
    #[must_use]
    pub fn input_gradient(&self, dz: &Matrix) -> Matrix {
        matrix::backward(dz.view(), self.base.linear.weight.matrix())
    }
}
