//! Cross entropy and its gradient with respect to the logits.

use ndarray::parallel::prelude::*;

use crate::matrix::Matrix;

/// The loss of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// The minimised sum.
    pub total: f64,
    /// The number of clouds whose most probable class has the largest share of the target.
    pub correct: usize,
}

/// The mean cross entropy of `logits` `[clouds, classes]` and `targets`, whose rows sum to 1, with
/// its gradient, which reuses the memory of the logits.
pub fn cross_entropy(mut logits: Matrix, targets: &Matrix) -> (Loss, Matrix) {
    let n = logits.nrows() as f64;
    let rows: Vec<(f64, bool)> = logits
        .axis_iter_mut(ndarray::Axis(0))
        .into_par_iter()
        .zip(targets.axis_iter(ndarray::Axis(0)))
        .map(|(mut logits, target)| {
            let logits = logits.as_slice_mut().expect("invariant: rows are contiguous");
            let target = target.to_slice().expect("invariant: rows are contiguous");
            let right = argmax(logits) == argmax(target);
            let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            let sum: f64 = logits.iter().map(|&x| libm::exp(f64::from(x - largest))).sum();
            let log_sum = libm::log(sum);
            let mut cost = 0.0;
            for (x, &t) in logits.iter_mut().zip(target) {
                let log_p = f64::from(*x - largest) - log_sum;
                cost -= f64::from(t) * log_p;
                *x = ((libm::exp(log_p) - f64::from(t)) / n) as f32;
            }
            (cost, right)
        })
        .collect();
    let total = rows.iter().map(|(cost, _)| cost).sum::<f64>() / n;
    let correct = rows.iter().filter(|(_, right)| *right).count();
    (Loss { total, correct }, logits)
}

/// The index of the largest of `values`; of equal values, the first.
fn argmax(values: &[f32]) -> usize {
    let largest = |best: usize, i: usize| if values[i] > values[best] { i } else { best };
    (0..values.len()).fold(0, largest)
}
