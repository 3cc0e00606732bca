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

impl Dense {
    /// The weight of `input` for `output`.
    #[inline]
    #[must_use]
    pub fn at(&self, input: usize, output: usize) -> f32 {
        self.weight[output * self.inputs + input]
    }

    /// Sets subnormal weights and biases to 0, which changes a sum of K products by at most K times
    /// 1.2e-38 times the largest activation. Training with an L2 term leaves such weights where a
    /// channel has died, and on x86-64 a product with one takes some hundred cycles: if a third of
    /// the weights of the feature T-Net are subnormal, the baseline takes five times as long.
    pub fn flush(&mut self) {
        let all = self.weight.iter_mut().chain(&mut self.bias);
        all.filter(|value| value.is_subnormal()).for_each(|value| *value = 0.0);
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
