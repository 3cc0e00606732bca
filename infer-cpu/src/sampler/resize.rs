//! Resizes ranked critical points to M points.
//!
//! Ranked rows come best first, with their scores. Without rows, every rule returns none.

use super::Resize;

/// A rule of resizing: its arguments are ranked rows, their scores, M, and the output.
type Rule = fn(&[u32], &[f64], usize, &mut Vec<u32>);

impl Resize {
    /// Writes `m` of `ranked` to `out` by this rule; only `truncate` may write fewer.
    pub fn apply(self, ranked: &[u32], scores: &[f64], m: usize, out: &mut Vec<u32>) {
        let rule: Rule = match self {
            Self::Truncate => truncate,
            Self::Cyclic => cyclic,
            Self::Nearest => nearest,
            Self::Weighted => weighted,
        };
        out.clear();
        if !ranked.is_empty() {
            rule(ranked, scores, m, out);
        }
    }
}

/// The first `m` rows; all, if there are fewer.
fn truncate(ranked: &[u32], _scores: &[f64], m: usize, out: &mut Vec<u32>) {
    out.extend(ranked.iter().take(m));
}

/// The first `m` rows; all in turn, over and over, if there are fewer.
fn cyclic(ranked: &[u32], _scores: &[f64], m: usize, out: &mut Vec<u32>) {
    out.extend(ranked.iter().cycle().take(m));
}

/// Row `floor(i * n / m)` at `i`: nearest neighbours by the low edge, as TensorFlow resizes images.
fn nearest(ranked: &[u32], _scores: &[f64], m: usize, out: &mut Vec<u32>) {
    out.extend((0..m).map(|i| ranked[i * ranked.len() / m]));
}

/// `nearest` for a ranking in which each row is repeated in proportion to its score: once for every
/// 2⁻³² of the sum of scores, rounded, and at least once.
fn weighted(ranked: &[u32], scores: &[f64], m: usize, out: &mut Vec<u32>) {
    let sum: f64 = scores.iter().sum();
    // If all scores are 0, the quotient is NaN, and the count becomes 1.
    let repetitions =
        |score: f64| u128::from(((score / sum * 4_294_967_296.0).round() as u64).max(1));
    // 128 bits, since M times this sum may exceed 64 bits.
    let length: u128 = scores.iter().map(|&score| repetitions(score)).sum();
    let mut row = 0;
    let mut end = repetitions(scores[0]);
    out.extend((0..m).map(|i| {
        while i as u128 * length / m as u128 >= end {
            row += 1;
            end += repetitions(scores[row]);
        }
        ranked[row]
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn resize(rule: Resize, ranked: &[u32], scores: &[f64], m: usize) -> Vec<u32> {
        let mut out = vec![];
        rule.apply(ranked, scores, m, &mut out);
        out
    }

    #[test]
    fn each_rule_shrinks_and_stretches_in_its_own_way() {
        let ranked = [7, 2, 9];
        let scores = [4.0, 2.0, 2.0];
        for (rule, two, five) in [
            (Resize::Truncate, &[7, 2], &[7, 2, 9][..]),
            (Resize::Cyclic, &[7, 2], &[7, 2, 9, 7, 2]),
            (Resize::Nearest, &[7, 2], &[7, 7, 2, 2, 9]),
            // The ranking is [7, 7, 2, 9], sampled at 0, 2 and at 0, 0.8, 1.6, 2.4, 3.2.
            (Resize::Weighted, &[7, 2], &[7, 7, 7, 2, 9]),
        ] {
            assert_eq!(resize(rule, &ranked, &scores, 2), two, "{rule}");
            assert_eq!(resize(rule, &ranked, &scores, 5), five, "{rule}");
            assert_eq!(resize(rule, &ranked, &scores, 3).len(), 3, "{rule}");
        }
    }

    #[test]
    fn one_row_or_none_is_no_special_case() {
        for rule in Resize::ALL {
            assert!(resize(rule, &[], &[], 4).is_empty(), "{rule}");
            let expected: &[u32] = if rule == Resize::Truncate { &[5] } else { &[5; 3] };
            assert_eq!(resize(rule, &[5], &[0.0], 3), expected, "{rule}");
        }
    }

    #[test]
    fn a_strong_point_crowds_weak_ones_out() {
        let scores = [1e30, 1.0, 1e-30];
        assert_eq!(resize(Resize::Weighted, &[0, 1, 2], &scores, 1000), [0; 1000]);
        let scores = [f64::INFINITY, 1.0];
        assert_eq!(resize(Resize::Weighted, &[0, 1], &scores, 4), [0, 0, 1, 1]);
    }

    proptest! {
        #[test]
        fn equal_scores_weigh_nothing(n in 1usize..50, m in 1usize..200, score in 0.0f64..10.0) {
            let ranked: Vec<_> = (0..n as u32).collect();
            let scores = vec![score; n];
            prop_assert_eq!(
                resize(Resize::Weighted, &ranked, &scores, m),
                resize(Resize::Nearest, &ranked, &scores, m)
            );
        }

        /// The repetitions of a row are off by at most 1/2 of 2^32, its ends by n of them, and m
        /// places sample an interval to within one.
        #[test]
        fn weighted_shares_are_those_of_the_scores(
            mut scores in prop::collection::vec(0.01f64..10.0, 1..30), m in 1usize..200,
        ) {
            scores.sort_by(|a, b| b.total_cmp(a));
            let ranked: Vec<_> = (0..scores.len() as u32).collect();
            let out = resize(Resize::Weighted, &ranked, &scores, m);
            prop_assert_eq!(out.len(), m);
            prop_assert!(out.is_sorted());
            let sum: f64 = scores.iter().sum();
            for (&row, score) in ranked.iter().zip(&scores) {
                let share = out.iter().filter(|&&other| other == row).count() as f64;
                prop_assert!((share - score / sum * m as f64).abs() < 1.0 + 1e-5);
            }
        }
    }
}
