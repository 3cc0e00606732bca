//! The calibration of a network on validation clouds: the temperature of its confidences, and the
//! energy above which it answers `unknown`.

use infer_cpu::energy;

/// The range of temperatures that is searched.
const TEMPERATURES: [f64; 2] = [0.05, 20.0];
/// Steps of the search. Each leaves 0.618 of the range, so that 40 steps leave 3e-8 of the range of
/// the logarithm, which is 6.
const STEPS: usize = 40;

/// The temperature at which the mean negative log-likelihood of `labels` under softmax(`logits` /
/// temperature) is smallest (Guo et al. 2017, "On calibration of modern neural networks").
///
/// This mean is convex in the inverse of the temperature, so that a golden-section search over the
/// logarithm finds its only minimum. Without clouds the temperature is 1.
#[must_use]
pub fn temperature(logits: &[Vec<f32>], labels: &[usize]) -> f64 {
    if logits.is_empty() {
        return 1.0;
    }
    let cost = |log: f64| {
        let t = libm::exp(log);
        // -ln p = -logit / t - energy / t.
        let loss = |(logits, &label): (&Vec<f32>, &usize)| {
            -f64::from(logits[label]) / t - energy(logits, t) / t
        };
        logits.iter().zip(labels).map(loss).sum::<f64>()
    };
    let share = (5f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = TEMPERATURES.map(libm::log);
    for _ in 0..STEPS {
        let [left, right] = [high - share * (high - low), low + share * (high - low)];
        if cost(left) < cost(right) { high = right } else { low = left }
    }
    libm::exp(low.midpoint(high))
}

/// The smallest of `energies` that `share` of them do not exceed. `None` if there are no energies.
#[must_use]
pub fn quantile(mut energies: Vec<f64>, share: f64) -> Option<f64> {
    energies.sort_by(f64::total_cmp);
    let rank = (share * energies.len() as f64).ceil() as usize;
    energies.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of clouds with logits (a, 0), a share p is of class 0: softmax is right at a / T = ln(p / (1
    /// - p)).
    #[test]
    fn the_temperature_makes_confidence_the_share_of_right_answers() {
        let logits = vec![vec![6.0, 0.0]; 100];
        let labels: Vec<usize> = (0..100).map(|i| usize::from(i >= 80)).collect();
        let found = temperature(&logits, &labels);
        assert!((found - 6.0 / 4f64.ln()).abs() < 1e-5, "{found}");
        assert_eq!(temperature(&[], &[]), 1.0);
        // Always right: so sure that rounding hides what is left of 1 - p.
        assert!(temperature(&logits, &[0; 100]) < 0.3);
    }

    #[test]
    fn a_quantile_is_one_of_the_values_and_enough_are_not_above_it() {
        let energies = || (0..20).rev().map(f64::from).collect::<Vec<_>>();
        assert_eq!(quantile(energies(), 0.95), Some(18.0));
        assert_eq!(quantile(energies(), 1.0), Some(19.0));
        assert_eq!(quantile(energies(), 0.01), Some(0.0));
        assert_eq!(quantile(vec![], 0.95), None);
    }
}
