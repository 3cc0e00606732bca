//! `z = W x + b`.

use formats::streams::Stream;
use ndarray::ArrayView2;

use crate::matrix::{self, Matrix};
use crate::parameter::Parameter;

/// A linear layer.
#[derive(Clone, Debug)]
pub struct Linear {
    /// W, `[outputs, inputs]`.
    pub weight: Parameter,
    /// b, `[outputs]`.
    pub bias: Parameter,
}

impl Linear {
    /// A layer with random weights, named `name`. Weights and biases are uniform in ±1/√inputs, as
    /// in PyTorch's `Linear` and `Conv1d`.
    pub fn new(name: &str, inputs: usize, outputs: usize, seed: u64) -> Self {
        let limit = 1.0 / (inputs as f64).sqrt();
        let draw = |part: &str, n: usize| {
            let stream = Stream::Parameter { layer: name, part }.key(seed);
            (0..n as u64).map(|i| ((2.0 * stream.unit(i) - 1.0) * limit) as f32).collect()
        };
        let parameter = |part: &str, shape: Vec<usize>| {
            let n = shape.iter().product();
            Parameter::new(format!("{name}.{part}"), shape, draw(part, n))
        };
        Self {
            weight: parameter("weight", vec![outputs, inputs]),
            bias: parameter("bias", vec![outputs]),
        }
    }

    /// The layer's name in model files.
    pub fn name(&self) -> &str {
        self.weight.name.trim_end_matches(".weight")
    }

    /// The numbers of inputs and outputs.
    pub fn size(&self) -> (usize, usize) {
        (self.weight.shape[1], self.weight.shape[0])
    }

    /// `z` without the bias, for a batch norm, which would remove the bias.
    pub fn products(&self, x: ArrayView2<'_, f32>) -> Matrix {
        matrix::product(x, self.weight.matrix().t())
    }

    /// `z`.
    pub fn forward(&self, x: ArrayView2<'_, f32>) -> Matrix {
        self.products(x) + ndarray::aview1(&self.bias.value)
    }

    /// Sets the gradients of the parameters, and returns the gradient of `x`.
    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dz: ArrayView2<'_, f32>) -> Matrix {
        self.backward_bias(dz);
        self.backward_products(x, dz);
        self.input_gradient(dz)
    }

    /// Sets only the gradient of the bias.
    pub fn backward_bias(&mut self, dz: ArrayView2<'_, f32>) {
        let bias = dz.sum_axis(ndarray::Axis(0));
        self.bias.gradient.copy_from_slice(bias.as_slice().expect("invariant: contiguous"));
    }

    /// Sets only the gradient of the weights. Before a batch norm, the gradient of the bias is 0.
    pub fn backward_products(&mut self, x: ArrayView2<'_, f32>, dz: ArrayView2<'_, f32>) {
        matrix::gradient(dz, x, &mut self.weight.gradient);
    }

    /// The gradient of `x`.
    pub fn input_gradient(&self, dz: ArrayView2<'_, f32>) -> Matrix {
        matrix::product(dz, self.weight.matrix())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_and_their_parts_begin_with_numbers_of_their_own() {
        let layer = |name, seed| Linear::new(name, 64, 64, seed);
        let (a, b) = (layer("a", 0), layer("b", 0));
        assert_ne!(a.weight.value, b.weight.value);
        assert_ne!(a.bias.value, b.bias.value);
        assert_ne!(a.weight.value[..64], a.bias.value[..]);
        assert_ne!(a.weight.value, layer("a", 1).weight.value);
        assert_eq!(a.weight.value, layer("a", 0).weight.value);
    }
}
