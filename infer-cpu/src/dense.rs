//! A linear layer of a model file, with its batch norm folded in.

use formats::weights::Tensor;

/// PyTorch's default epsilon of batch norms, which the baseline uses.
const BATCH_NORM_EPSILON: f64 = 1e-5;

/// `y = W x + b`, optionally followed by a ReLU.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// The layer's name in the model file.
    pub name: String,
    /// Inputs.
    pub inputs: usize,
    /// Outputs.
    pub outputs: usize,
    /// W, `[outputs, inputs]` in C order.
    pub weight: Vec<f32>,
    /// b, `[outputs]`.
    pub bias: Vec<f32>,
    /// Whether negative outputs become 0.
    pub relu: bool,
}

/// A batch norm in evaluation mode, `[outputs]` each.
pub struct BatchNorm {
    /// γ.
    pub weight: Tensor,
    /// β.
    pub bias: Tensor,
    /// Mean of the training set.
    pub mean: Tensor,
    /// Variance of the training set.
    pub variance: Tensor,
}

impl Dense {
    /// The weight of `input` for `output`.
    #[must_use]
    pub fn at(&self, input: usize, output: usize) -> f32 {
        self.weight[output * self.inputs + input]
    }

    /// Folds the batch norm that follows into weights and biases, in f64.
    pub fn fold(&mut self, norm: &BatchNorm) {
        for output in 0..self.outputs {
            let at = |tensor: &Tensor| f64::from(tensor.values[output]);
            let scale = at(&norm.weight) / (at(&norm.variance) + BATCH_NORM_EPSILON).sqrt();
            for weight in &mut self.weight[output * self.inputs..][..self.inputs] {
                *weight = (f64::from(*weight) * scale) as f32;
            }
            let bias = f64::from(self.bias[output]);
            self.bias[output] = ((bias - at(&norm.mean)) * scale + at(&norm.bias)) as f32;
        }
    }

    /// Sets subnormal weights and biases to 0, which changes a sum of K products by at most K times
    /// 1.2e-38 times the largest activation. Training with an L2 term leaves such weights where a
    /// channel has died, and on x86-64 a product with one takes some hundred cycles: if a third of
    /// the weights of the feature T-Net are subnormal, the baseline takes five times as long.
    pub fn flush(&mut self) {
        let all = self.weight.iter_mut().chain(&mut self.bias);
        all.filter(|value| value.is_subnormal()).for_each(|value| *value = 0.0);
    }

    /// The largest sum of weight magnitudes of an output: with activations of at most 1, no partial
    /// sum exceeds it.
    #[must_use]
    pub fn gain(&self) -> f32 {
        let rows = self.weight.chunks_exact(self.inputs.max(1));
        rows.map(|row| row.iter().map(|w| w.abs()).sum()).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subnormal_weights_and_biases_become_0_and_no_others() {
        let weight = vec![1e-40, -1e-45, f32::MIN_POSITIVE, -0.5];
        let (name, bias) = ("fc1".to_owned(), vec![2e-39, -f32::MIN_POSITIVE]);
        let mut dense = Dense { name, inputs: 2, outputs: 2, weight, bias, relu: false };
        dense.flush();
        assert_eq!(dense.weight, [0.0, 0.0, f32::MIN_POSITIVE, -0.5]);
        assert_eq!(dense.bias, [0.0, -f32::MIN_POSITIVE]);
    }
}
