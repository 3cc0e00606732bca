//! A layer after a pooling: linear, perhaps dropout, batch norm, ReLU.

use ndarray::ArrayView2;

use super::norm::Saved;
use super::{Folded, Learns, Linear, Norm};
use crate::matrix::{self, Matrix};
use crate::parameter::Parameter;

/// A layer that takes one vector a cloud.
#[derive(Clone, Debug)]
pub struct VectorLayer {
    linear: Linear,
    norm: Norm,
    saved: Saved,
    output: Matrix,
    kept: Option<Matrix>,
}

impl VectorLayer {
    /// A layer whose parts are named `linear` and `norm`.
    #[must_use]
    pub fn new(linear: &str, norm: &str, (inputs, outputs): (usize, usize), seed: u64) -> Self {
        Self {
            linear: Linear::new(linear, inputs, outputs, seed),
            norm: Norm::new(norm, outputs),
            saved: Saved::default(),
            output: Matrix::default((0, outputs)),
            kept: None,
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

    /// Takes `x` `[clouds, inputs]` through the layer. `kept` is dropout's mask
    /// between product and batch norm, scaled by 1 / share kept.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, kept: Option<Matrix>, momentum: f32) {
        let mut z = self.linear.products(x);
        let n = z.nrows();
        let ones = vec![1.0; n];
        let mut bias = &self.linear.bias.value;
        let none = vec![0.0; bias.len()];
        if let Some(kept) = &kept {
            // What is dropped loses its bias too, so that it matters here.
            z += &ndarray::aview1(bias);
            z *= kept;
            bias = &none;
        }
        (self.output, self.saved) = self.norm.forward(z, (&ones, n as f32), bias, (momentum, true));
        self.kept = kept;
    }

    /// Sets gradients from that of the output; returns that of `x`.
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dy: Matrix) -> Matrix {
        let ones = vec![1.0; dy.nrows()];
        let n = dy.nrows() as f32;
        let mut dz = self.norm.backward(dy, Some(&self.output), &self.saved, (&ones, n));
        if let Some(kept) = &self.kept {
            dz *= kept;
            return self.linear.backward(x, dz.view());
        }
        self.linear.backward_products(x, dz.view());
        matrix::backward(dz.view(), self.linear.weight.matrix())
    }
}

impl Learns for VectorLayer {
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
