//! Confidence intervals of shares.

/// The 97.5 % quantile of the normal distribution.
pub const Z: f64 = 1.959_963_984_540_054;

/// The 95 % interval of a share of `hits` in `n` trials (Wilson 1927).
#[must_use]
pub fn wilson(hits: usize, n: usize) -> (f64, f64) {
    if n == 0 {
        return (0.0, 1.0);
    }
    wilson_of(hits as f64 / n as f64, n)
}

/// As [`wilson`], of a `share` of `n` trials, 1 or more.
#[must_use]
pub fn wilson_of(share: f64, n: usize) -> (f64, f64) {
    let n = n as f64;
    let centre = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    ((centre - half) / scale, (centre + half) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brown, Cai and DasGupta 2001, table of Wilson intervals: 0 of 10 gives
    /// (0, 0.2775), 5 of 10 (0.2366, 0.7634).
    #[test]
    fn intervals_equal_published_ones() {
        let near = |(low, high): (f64, f64), expected: (f64, f64)| {
            (low - expected.0).abs() < 5e-5 && (high - expected.1).abs() < 5e-5
        };
        assert!(near(wilson(0, 10), (0.0, 0.2775)));
        assert!(near(wilson(5, 10), (0.2366, 0.7634)));
        assert_eq!(wilson(0, 0), (0.0, 1.0));
    }
}
