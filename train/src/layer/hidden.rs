//! A hidden layer: linear, perhaps dropout, batch norm, ReLU. It is applied to each
//! point alone or, after a pooling, to one vector of each cloud.

use ndarray::ArrayView2;

use super::norm::Saved;
use super::{Normed, Rows};
use crate::matrix::Matrix;

/// A layer that is applied to each row alone.
#[derive(Clone, Debug)]
pub struct HiddenLayer {
    /// Its parameters and its last output.
    pub base: Normed,
    saved: Saved,
    kept: Option<Matrix>,
}

impl HiddenLayer {
    /// A layer whose parts are named `linear` and `norm`.
    #[must_use]
    pub fn new(linear: &str, norm: &str, size: (usize, usize), seed: u64) -> Self {
        Self { base: Normed::new(linear, norm, size, seed), saved: Saved::default(), kept: None }
    }

    /// Takes `x` `[rows, inputs]` through the layer. `kept` is the dropout mask
    /// between product and batch norm, scaled by 1 / share kept.
    pub fn forward(
        &mut self,
        x: ArrayView2<'_, f32>,
        rows: Rows<'_>,
        kept: Option<Matrix>,
        momentum: f32,
    ) {
        let mut z = self.base.linear.products(x);
        let mut bias = &self.base.linear.bias.value;
        let none = vec![0.0; bias.len()];
        if let Some(kept) = &kept {
            // Dropped features lose their bias too, so that it has to be added here.
            z += &ndarray::aview1(bias);
            z *= kept;
            bias = &none;
        }
        (self.base.output, self.saved) = self.base.norm.forward(z, rows, bias, momentum);
        self.kept = kept;
    }

    /// Sets the parameters' gradients from that of the output; returns that of the
    /// product, for [`Linear::input_gradient`](super::Linear::input_gradient).
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dy: Matrix, rows: Rows<'_>) -> Matrix {
        let mut dz = self.base.norm.backward(dy, &self.base.output, &self.saved, rows);
        if let Some(kept) = &self.kept {
            dz *= kept;
            self.base.linear.backward_bias(dz.view());
        }
        self.base.linear.backward_products(x, dz.view());
        dz
    }
}
