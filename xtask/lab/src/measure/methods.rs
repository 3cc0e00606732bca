//! Exact ranges, and the errors of others.

use super::ray_set::RaySet;
use rayon::prelude::*;
use serde::Serialize;
use sim_gpu::internals::cpu::oracle;

/// The f64 oracle; `[n_rays]`, metres.
pub fn in_f64(ray_set: &RaySet) -> Vec<Option<f64>> {
    let target = &ray_set.job.target;
    ray_set.rays.par_iter().map(|ray| oracle::nearest(target, ray).map(|c| c.range_m)).collect()
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    pub rays_compared: usize,
    /// Rays that hit something where the oracle finds nothing.
    pub false_hits: usize,
    /// Rays that hit nothing where the oracle finds something.
    pub misses: usize,
    pub worst_m: f64,
    pub rms_m: f64,
}

impl Accuracy {
    /// Compares `ranges` with `truth`, both `[n_rays]`, metres.
    pub fn of(ranges: &[Option<f64>], truth: &[Option<f64>]) -> Self {
        let mut accuracy =
            Self { rays_compared: truth.len(), false_hits: 0, misses: 0, worst_m: 0.0, rms_m: 0.0 };
        let (mut sum_of_squares, mut both_hit) = (0.0, 0usize);
        for pair in ranges.iter().zip(truth) {
            match pair {
                (Some(found), Some(true_m)) => {
                    let error_m = (found - true_m).abs();
                    accuracy.worst_m = accuracy.worst_m.max(error_m);
                    sum_of_squares += error_m * error_m;
                    both_hit += 1;
                }
                (Some(_), None) => accuracy.false_hits += 1,
                (None, Some(_)) => accuracy.misses += 1,
                (None, None) => {}
            }
        }
        accuracy.rms_m = (sum_of_squares / both_hit.max(1) as f64).sqrt();
        accuracy
    }
}

#[cfg(test)]
mod tests {
    use super::Accuracy;

    #[test]
    fn hits_and_misses_are_told_apart() {
        let found = [Some(1.0), Some(2.0), None, None, Some(5.0)];
        let truth = [Some(1.0), None, Some(3.0), None, Some(5.5)];
        let accuracy = Accuracy::of(&found, &truth);
        assert_eq!((accuracy.false_hits, accuracy.misses), (1, 1));
        assert_eq!((accuracy.worst_m, accuracy.rms_m), (0.5, 0.125f64.sqrt()));
    }
}
