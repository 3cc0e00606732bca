//! A point-wise layer: linear, batch norm, ReLU.

use ndarray::ArrayView2;

use super::norm::Saved;
use super::{Folded, Learns, Linear, Norm, Rows};
use crate::matrix::{self, Matrix};
use crate::parameter::Parameter;

/// A layer that takes each point by itself.
#[derive(Clone, Debug)]
pub struct PointLayer {
    linear: Linear,
    norm: Norm,
    saved: Saved,
    output: Matrix,
}

impl PointLayer {
    /// A layer whose parts are named `linear` and `norm`.
    #[must_use]
    pub fn new(linear: &str, norm: &str, (inputs, outputs): (usize, usize), seed: u64) -> Self {
        Self {
            linear: Linear::new(linear, inputs, outputs, seed),
            norm: Norm::new(norm, outputs),
            saved: Saved::default(),
            output: Matrix::default((0, outputs)),
        }
    }

    /// What the last forward pass gave.
    #[must_use]
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.output.view()
    }

    /// The layer's name, if its last output is not finite.
    #[must_use]
    pub fn not_finite(&self) -> Option<&str> {
        self.linear.not_finite(&self.output)
    }

    /// Takes `x` `[rows, inputs]` through the layer.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        let z = self.linear.products(x);
        let bias = &self.linear.bias.value;
        (self.output, self.saved) =
            self.norm.forward(z, (rows.weights, rows.total), bias, (momentum, true));
    }

    /// Sets gradients from that of the output and returns that of the product,
    /// for [`PointLayer::input_gradient`].
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dy: Matrix, rows: Rows<'_>) -> Matrix {
        let weights = (rows.weights, rows.total);
        let dz = self.norm.backward(dy, Some(&self.output), &self.saved, weights);
        self.linear.backward_products(x, dz.view());
        dz
    }

    /// The gradient of the inputs.
    #[must_use]
    pub fn input_gradient(&self, dz: &Matrix) -> Matrix {
        matrix::backward(dz.view(), self.linear.weight.matrix())
    }
}

impl Learns for PointLayer {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.linear.parameters(visit);
        self.norm.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.norm.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        visit(self.norm.folded_into(&self.linear));
    }
}
