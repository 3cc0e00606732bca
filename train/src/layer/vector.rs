//! A layer after a pooling: linear, perhaps dropout, batch norm, ReLU.

use ndarray::ArrayView2;

use super::Normed;
use super::norm::Saved;
use crate::matrix::{self, Matrix};

/// A layer that is applied to one vector of each cloud.
#[derive(Clone, Debug)]
pub struct VectorLayer {
    /// Its parameters and its last output.
    pub base: Normed,
    saved: Saved,
    kept: Option<Matrix>,
}

impl VectorLayer {
    /// A layer whose parts are named `linear` and `norm`.
    #[must_use]
    pub fn new(linear: &str, norm: &str, size: (usize, usize), seed: u64) -> Self {
        Self { base: Normed::new(linear, norm, size, seed), saved: Saved::default(), kept: None }
    }

    /// Takes `x` `[clouds, inputs]` through the layer. `kept` is the dropout mask
    /// between product and batch norm, scaled by 1 / share kept.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, kept: Option<Matrix>, momentum: f32) {
        let mut z = self.base.linear.products(x);
        let n = z.nrows();
        let ones = vec![1.0; n];
        let mut bias = &self.base.linear.bias.value;
        let none = vec![0.0; bias.len()];
        if let Some(kept) = &kept {
            // Dropped features lose their bias too, so that it has to be added here.
            z += &ndarray::aview1(bias);
            z *= kept;
            bias = &none;
        }
        (self.base.output, self.saved) =
            self.base.norm.forward(z, (&ones, n as f32), bias, (momentum, true));
        self.kept = kept;
    }

    /// Sets the parameters' gradients from that of the output; returns that of `x`.
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dy: Matrix) -> Matrix {
        let ones = vec![1.0; dy.nrows()];
        let n = dy.nrows() as f32;
        let mut dz = self.base.norm.backward(dy, Some(&self.base.output), &self.saved, (&ones, n));
        if let Some(kept) = &self.kept {
            dz *= kept;
            return self.base.linear.backward(x, dz.view());
        }
        self.base.linear.backward_products(x, dz.view());
        matrix::backward(dz.view(), self.base.linear.weight.matrix())
    }
}
