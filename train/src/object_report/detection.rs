//! The separation of negatives from known objects by a score, and the calibration error of
//! confidences.

/// The separation of negatives, which should have larger scores, from known objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// The probability that a negative has a larger score than a known object: the area under the
    /// receiver operating characteristic.
    pub auroc: f64,
    /// The share of negatives that are taken for known objects at the threshold that keeps 95 % of
    /// the known objects.
    pub fpr_at_95: f64,
}

/// The separation by the scores of `known` objects and of `negatives`. `None` if there are no
/// objects of either kind.
#[must_use]
pub fn detection(known: &[f64], negatives: &[f64]) -> Option<Detection> {
    let threshold = crate::calibration::quantile(known.to_vec(), 0.95)?;
    if negatives.is_empty() {
        return None;
    }
    let mut sorted = known.to_vec();
    sorted.sort_by(f64::total_cmp);
    // Mann and Whitney 1947: an equal score counts half.
    let wins = negatives.iter().map(|score| {
        let below = sorted.partition_point(|known| known < score);
        let up_to = sorted.partition_point(|known| known <= score);
        0.5 * (below + up_to) as f64
    });
    let n = negatives.len() as f64;
    let accepted = negatives.iter().filter(|&&score| score <= threshold).count();
    Some(Detection {
        auroc: wins.sum::<f64>() / (n * known.len() as f64),
        fpr_at_95: accepted as f64 / n,
    })
}

/// Number of bins of the expected calibration error (Guo et al. 2017).
const BINS: usize = 15;

/// The expected calibration error of `answers`, each of which is a confidence and whether the
/// answer is right. It is the mean difference between confidence and accuracy over bins of
/// confidence, and 0 without answers.
#[must_use]
pub fn calibration_error(answers: &[(f64, bool)]) -> f64 {
    let mut bins = [(0.0, 0.0); BINS];
    for &(confidence, is_right) in answers {
        let bin = ((confidence * BINS as f64) as usize).min(BINS - 1);
        bins[bin].0 += confidence;
        bins[bin].1 += f64::from(u8::from(is_right));
    }
    let distance = bins.iter().map(|(confidence, right)| (confidence - right).abs());
    distance.sum::<f64>() / answers.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_score_that_separates_has_an_area_of_one_and_an_equal_one_of_a_half() {
        let known: Vec<f64> = (0..100).map(f64::from).collect();
        let found = |negatives: &[f64]| detection(&known, negatives).unwrap();
        assert_eq!(found(&[100.0, 200.0]), Detection { auroc: 1.0, fpr_at_95: 0.0 });
        assert_eq!(found(&[-1.0]), Detection { auroc: 0.0, fpr_at_95: 1.0 });
        assert_eq!(found(&known).auroc, 0.5);
        assert_eq!(found(&known).fpr_at_95, 0.95);
        assert_eq!(detection(&[], &[1.0]), None);
        assert_eq!(detection(&known, &[]), None);
    }

    #[test]
    fn confidences_are_compared_with_shares_of_right_answers() {
        // Sure of 90 %, right in half; sure of all, and right.
        let answers = [(0.9, true), (0.9, false), (1.0, true), (1.0, true)];
        // Both are in the bins from 0.867 and from 0.933.
        assert!((calibration_error(&answers) - 0.2).abs() < 1e-12);
        assert_eq!(calibration_error(&[]), 0.0);
    }
}
