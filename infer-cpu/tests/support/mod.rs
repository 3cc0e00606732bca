//! What several tests of infer-cpu need.

use formats::weights::Tensor;

/// The points of a tensor `[1, 3, n]`.
pub fn channels_first(tensor: &Tensor) -> Vec<[f32; 3]> {
    let n = tensor.shape[2];
    (0..n).map(|i| [0, 1, 2].map(|axis| tensor.values[axis * n + i])).collect()
}
