//! Batch norms of a model file, which are folded into the layers before them.

use edgepuck_kernels::Dense;
use formats::weights::Tensor;

/// PyTorch's default epsilon of batch norms, which the baseline uses.
const EPSILON: f64 = 1e-5;

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

impl BatchNorm {
    /// Folds this batch norm into the weights and biases of the layer before it, in f64.
    pub fn fold_into(&self, dense: &mut Dense) {
        for output in 0..dense.outputs {
            let at = |tensor: &Tensor| f64::from(tensor.values[output]);
            let scale = at(&self.weight) / (at(&self.variance) + EPSILON).sqrt();
            for weight in &mut dense.weight[output * dense.inputs..][..dense.inputs] {
                *weight = (f64::from(*weight) * scale) as f32;
            }
            let bias = f64::from(dense.bias[output]);
            dense.bias[output] = ((bias - at(&self.mean)) * scale + at(&self.bias)) as f32;
        }
    }
}
