//! A hidden layer: linear, optional dropout, batch norm, ReLU. It takes each point separately or,
//! after a pooling, one vector of each cloud.

use ndarray::ArrayView2;

use super::Normed;
use super::norm::Saved;
use crate::batch::Rows;
use crate::matrix::Matrix;

/// A layer that takes each row separately.
#[derive(Clone, Debug)]
pub struct HiddenLayer {
    /// The parameters and the last output.
    pub base: Normed,
    saved: Saved,
    kept: Option<Matrix>,
}

impl HiddenLayer {
    /// A layer with random weights, whose parts are named `linear` and `norm`.
    pub fn new(linear: &str, norm: &str, size: (usize, usize), seed: u64) -> Self {
        Self { base: Normed::new(linear, norm, size, seed), saved: Saved::default(), kept: None }
    }

    /// Applies the layer to `x` `[rows, inputs]`. `kept` is the dropout mask before the batch norm.
    /// Its elements are 0 or 1 / the share of kept features.
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
            // Dropout also drops the bias, so that it must be added first.
            z += &ndarray::aview1(bias);
            z *= kept;
            bias = &none;
        }
        (self.base.output, self.saved) = self.base.norm.forward(z, rows, bias, momentum);
        self.kept = kept;
    }

    /// Sets the gradients of the parameters from the gradient `dy` of the output. Returns the
    /// gradient of the product, for [`Linear::input_gradient`](super::Linear::input_gradient).
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
