//! Ratios of paired measurements.

/// A median, and where it lies with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The median of the sample.
    pub median: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// Of `above[i] / below[i]`; at least six pairs, or it is no interval of
    /// 95 % but the sample's extremes.
    ///
    /// Between two order statistics, whatever the distribution: each pair falls
    /// on either side of the true median with probability 1/2.
    pub fn of_ratios(above: &[f64], below: &[f64]) -> Self {
        let mut ratios: Vec<f64> = above.iter().zip(below).map(|(p, q)| p / q).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let beyond = beyond_each_end(ratios.len());
        let at = |i: usize| ratios.get(i).copied().unwrap_or(f64::NAN);
        let high = at(ratios.len().saturating_sub(1 + beyond));
        Self { low: at(beyond), median: median(ratios.clone()), high }
    }
}

/// The upper median.
pub fn median(mut sample: Vec<f64>) -> f64 {
    sample.sort_unstable_by(f64::total_cmp);
    sample.get(sample.len() / 2).copied().unwrap_or(f64::NAN)
}

/// How many of `n` values may be left out at each end: the most k with
/// P(fewer than k + 1 of n coins are heads) at most 2.5 %.
fn beyond_each_end(n: usize) -> usize {
    let mut probability = 0.5f64.powi(n as i32);
    let mut sum = probability;
    let mut k = 0;
    while sum <= 0.025 && k < n {
        k += 1;
        probability *= (n - k + 1) as f64 / k as f64;
        sum += probability;
    }
    k.saturating_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ranks_are_those_of_the_binomial_tables() {
        // Conover, "Practical Nonparametric Statistics": n = 10 gives the 2nd
        // and the 9th of ten, n = 20 the 6th and the 15th, n = 100 the 40th
        // and the 61st.
        for (n, beyond) in [(6, 0), (10, 1), (20, 5), (100, 39)] {
            assert_eq!(beyond_each_end(n), beyond, "{n}");
        }
    }

    #[test]
    fn equal_pairs_have_the_ratio_1_and_no_width() {
        let sample = [3.0, 5.0, 4.0, 8.0, 1.0, 2.0];
        let expected = Interval { low: 1.0, median: 1.0, high: 1.0 };
        assert_eq!(Interval::of_ratios(&sample, &sample), expected);
    }

    #[test]
    fn one_wild_pair_moves_nothing() {
        let below = [1.0; 20];
        let mut above = [1.5; 20];
        above[7] = 1e9;
        let expected = Interval { low: 1.5, median: 1.5, high: 1.5 };
        assert_eq!(Interval::of_ratios(&above, &below), expected);
    }
}
