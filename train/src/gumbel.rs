//! A relaxed selection of critical points, with which the network's own loss trains the point
//! encoder: Gumbel-top-k with a straight-through estimator (Kool et al. 2019; Bengio et al. 2013).
//! The paper names it as future work.
//!
//! The forward pass takes the k points with the largest ln(score) + Gumbel noise: k draws without
//! replacement, with probabilities in proportion to the scores. The backward pass treats the
//! coordinates of each point as multiplied by a weight w, which is 1 in the forward pass, and k p
//! in the backward pass, where p = score / Σ scores is the probability of the first draw. Therefore
//! dL/dw is the dot product of the point and its gradient.

use formats::rng::StreamKey;

/// The `keep` rows with the largest perturbed scores, in descending order. The noise of a row is
/// keyed by `stream` and the row's place in the ranking.
#[must_use]
pub fn top(rows: &[u32], scores: &[f64], keep: usize, stream: StreamKey) -> Vec<u32> {
    let perturbed = |(place, (&row, &score)): (usize, (&u32, &f64))| {
        // The draw can be 0, whose logarithm is not finite.
        let draw = stream.unit(place as u64).max(f64::MIN_POSITIVE);
        (libm::log(score) - libm::log(-libm::log(draw)), row)
    };
    let mut all: Vec<(f64, u32)> = rows.iter().zip(scores).enumerate().map(perturbed).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    all.truncate(keep);
    all.into_iter().map(|(_, row)| row).collect()
}

/// The gradients of `scores`. `weight_gradients` holds dL/dw of each point; it is 0 for points that
/// were not taken.
#[must_use]
pub fn score_gradients(scores: &[f64], weight_gradients: &[f64], keep: usize) -> Vec<f64> {
    let total: f64 = scores.iter().sum();
    if total.is_nan() || total <= 0.0 {
        return vec![0.0; scores.len()];
    }
    let mean: f64 = scores.iter().zip(weight_gradients).map(|(s, g)| s * g).sum::<f64>() / total;
    weight_gradients.iter().map(|g| keep as f64 / total * (g - mean)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_draws_are_in_proportion_to_scores() {
        let (rows, scores) = ([4, 7, 9], [1.0, 2.0, 5.0]);
        let mut counts = [0; 3];
        for i in 0..8000 {
            let first = top(&rows, &scores, 1, StreamKey::new(1, "gumbel test", i))[0];
            counts[rows.iter().position(|&row| row == first).unwrap()] += 1;
        }
        // Binomial: standard deviations of 30, 39 and 43; four of those.
        for (count, expected) in counts.into_iter().zip([1000i32, 2000, 5000]) {
            assert!((count - expected).abs() < 175, "{counts:?}");
        }
        let all = top(&rows, &scores, 9, StreamKey::new(1, "gumbel test", 0));
        assert_eq!(all.len(), 3);
    }

    #[test]
    fn gradients_are_those_of_the_relaxed_weights() {
        let (scores, through, keep) = ([0.5, 2.0, 1.5, 3.0], [0.3, 0.0, -1.2, 0.8], 2);
        let loss = |scores: &[f64]| {
            let total: f64 = scores.iter().sum();
            let weights = scores.iter().map(|s| keep as f64 * s / total);
            weights.zip(through).map(|(w, g)| w * g).sum::<f64>()
        };
        for (i, found) in score_gradients(&scores, &through, keep).into_iter().enumerate() {
            let h = 1e-6;
            let at = |by: f64| {
                let mut moved = scores;
                moved[i] += by;
                loss(&moved)
            };
            // Central differences: off by h² and by 1e-16 / h.
            assert!((found - (at(h) - at(-h)) / (2.0 * h)).abs() < 1e-8);
        }
        assert_eq!(score_gradients(&[0.0, 0.0], &[1.0, 1.0], 1), [0.0, 0.0]);
    }
}
