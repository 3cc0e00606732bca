//! Figures of a set of samples.

/// The `q` quantile of `samples` by the nearest rank; NaN of none.
pub fn quantile(samples: &[f64], q: f64) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

#[cfg(feature = "trade")]
/// The 95 % interval of a share of `hits` in `n` trials (Wilson 1927).
pub fn wilson_interval(hits: usize, n: usize) -> (f64, f64) {
    /// The 97.5 % quantile of the normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
    if n == 0 {
        return (0.0, 1.0);
    }
    let (n, share) = (n as f64, hits as f64 / n as f64);
    let centre = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    ((centre - half) / scale, (centre + half) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_samples() {
        let samples = [3.0, 1.0, 2.0, 4.0];
        assert_eq!([0.0, 0.5, 0.99, 1.0].map(|q| quantile(&samples, q)), [1.0, 2.0, 4.0, 4.0]);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[cfg(feature = "trade")]
    /// Brown, Cai and DasGupta 2001, table of Wilson intervals: 0 of 10 gives
    /// (0, 0.2775), 5 of 10 (0.2366, 0.7634).
    #[test]
    fn intervals_are_wilson_s() {
        let near = |(low, high): (f64, f64), expected: (f64, f64)| {
            (low - expected.0).abs() < 5e-5 && (high - expected.1).abs() < 5e-5
        };
        assert!(near(wilson_interval(0, 10), (0.0, 0.2775)));
        assert!(near(wilson_interval(5, 10), (0.2366, 0.7634)));
        assert_eq!(wilson_interval(0, 0), (0.0, 1.0));
    }
}
