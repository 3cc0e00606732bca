//! How ranges compare with the f64 oracle's.

use serde::Serialize;

/// Counts and errors over a set of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Rays compared.
    pub rays_compared: usize,
    /// Rays that hit something where the oracle finds nothing.
    pub false_hits: usize,
    /// Rays that hit nothing where the oracle finds something.
    pub misses: usize,
    /// Greatest difference of two ranges, metres.
    pub worst_m: f64,
    /// Root of the mean square of the differences, metres.
    pub rms_m: f64,
}

impl Accuracy {
    /// Of `ranges` against `truth`, both `[n_rays]`, metres.
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

    /// Of a million rays, how many hit nothing that is there.
    pub fn false_hits_per_million(&self) -> f64 {
        self.false_hits as f64 / self.rays_compared.max(1) as f64 * 1e6
    }

    /// Of a million rays, how many miss what is there.
    pub fn misses_per_million(&self) -> f64 {
        self.misses as f64 / self.rays_compared.max(1) as f64 * 1e6
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
        assert_eq!(accuracy.misses_per_million(), 200_000.0);
    }
}
