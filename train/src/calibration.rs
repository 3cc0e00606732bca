//! The temperature of a network's confidences, fitted to validation clouds.

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
pub fn temperature(logits: &[Vec<f32>], labels: &[usize]) -> f64 {
    if logits.is_empty() {
        return 1.0;
    }
    let cost = |log: f64| {
        let t = libm::exp(log);
        // -ln p = ln(sum of exp(other / t)) - logit / t, from the largest logit, so that nothing overflows.
        let loss = |(logits, &label): (&Vec<f32>, &usize)| {
            let largest = f64::from(logits.iter().copied().fold(f32::NEG_INFINITY, f32::max));
            let shifted = |&logit: &f32| libm::exp((f64::from(logit) - largest) / t);
            let energy = -largest - t * libm::log(logits.iter().map(shifted).sum::<f64>());
            -f64::from(logits[label]) / t - energy / t
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
}
