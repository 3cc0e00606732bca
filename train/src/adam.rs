//! Adam with an L2 term in the gradient, as in PyTorch's `Adam(weight_decay)` (Kingma and Ba 2015,
//! algorithm 1).

use rayon::prelude::*;

use crate::layer::Module;
use crate::parameter::Parameter;

/// Number of elements that one thread updates at a time.
const CHUNK: usize = 1 << 14;

/// A weight closer to 0 than this becomes 0, and so do its moments below these. A weight that only
/// the L2 term moves shrinks by a factor in each step until it is subnormal, and arithmetic of
/// subnormal numbers takes a hundred times as long. An output is a sum of some 1e-2 or more, rounded
/// to 1e-9; such a weight adds 1e-12 times an activation of about 1. In the update,
/// [`EPSILON`] outweighs the root of such a square, 1e-15.
const LEAST_WEIGHT: f32 = 1e-12;
const LEAST_MEAN: f32 = 1e-20;
const LEAST_SQUARE: f32 = 1e-30;

/// The baseline's decays of the running means of gradients and of their squares, the number that is
/// added to the root of the mean square, and the share of each weight that is added to its gradient
/// (yanx27, `train_classification.py`).
const BETAS: [f64; 2] = [0.9, 0.999];
const EPSILON: f32 = 1e-8;
const L2: f32 = 1e-4;

/// Updates all parameters of `network` in step number `step`, counted from 1, with learning rate
/// `rate`.
pub fn step(network: &mut dyn Module, step: u64, rate: f64) {
    network.parameters().into_iter().for_each(|p| update(p, step, rate));
}

fn update(parameter: &mut Parameter, step: u64, rate: f64) {
    let [beta1, beta2] = BETAS;
    let correction = |beta: f64| 1.0 - libm::pow(beta, step as f64);
    let size = (rate / correction(beta1)) as f32;
    let root = (1.0 / correction(beta2).sqrt()) as f32;
    let [beta1, beta2] = BETAS.map(|beta| beta as f32);
    let Parameter { value, gradient, mean, square, .. } = parameter;
    value
        .par_chunks_mut(CHUNK)
        .zip(gradient.par_chunks(CHUNK))
        .zip(mean.par_chunks_mut(CHUNK).zip(square.par_chunks_mut(CHUNK)))
        .for_each(|((value, gradient), (mean, square))| {
            let moments = mean.iter_mut().zip(square);
            for ((value, gradient), (mean, square)) in value.iter_mut().zip(gradient).zip(moments) {
                let g = gradient + L2 * *value;
                *mean = or_zero(*mean + (1.0 - beta1) * (g - *mean), LEAST_MEAN);
                *square = or_zero(beta2 * *square + (1.0 - beta2) * g * g, LEAST_SQUARE);
                let moved = size * *mean / (square.sqrt() * root + EPSILON);
                *value = or_zero(*value - moved, LEAST_WEIGHT);
            }
        });
}

/// `x`, or 0 if it is closer to 0 than `least`.
fn or_zero(x: f32, least: f32) -> f32 {
    if x.abs() < least { 0.0 } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a constant gradient, each step is the rate: the means are corrected for their start at 0.
    #[test]
    fn a_constant_gradient_moves_a_weight_by_the_rate_in_each_step() {
        let mut weight = Parameter::new("w".to_owned(), vec![2], vec![0.0, 0.0]);
        weight.gradient = vec![1.0, -50.0];
        (1..=10).for_each(|step| update(&mut weight, step, 1e-3));
        // 1 - 0.999 in f32 is off by 1.3e-5 of itself.
        let near = |found: f32, expected: f64| (f64::from(found) / expected - 1.0).abs() < 2e-5;
        assert!(near(weight.value[0], -0.01) && near(weight.value[1], 0.01), "{weight:?}");
        assert!(near(weight.mean[0], 1.0 - 0.9f64.powi(10)), "{weight:?}");
        assert!(near(weight.square[0], 1.0 - 0.999f64.powi(10)), "{weight:?}");
    }

    #[test]
    fn a_weight_that_only_the_l2_term_moves_ends_at_0_and_is_never_subnormal() {
        let mut weight = Parameter::new("w".to_owned(), vec![2], vec![0.1, -1e-19]);
        for step in 1..=100_000 {
            update(&mut weight, step, 1e-3);
            let all = [&weight.value, &weight.mean, &weight.square].into_iter().flatten();
            assert!(all.into_iter().all(|x| !x.is_subnormal()), "step {step}: {weight:?}");
        }
        let all = [weight.value, weight.mean, weight.square].concat();
        assert!(all.iter().all(|x| *x == 0.0), "{all:?}");
    }
}
