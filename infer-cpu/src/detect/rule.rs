//! Which cut of a hierarchy is taken: the one that its answers explain best.

use crate::classify::classifier::Classifier;
use crate::classify::prediction::Prediction;

/// How much an unknown object counts beside a known one of the same probability.
const WEIGHT_OF_UNKNOWN: f64 = 0.8;

/// A cluster is kept whole if it is worth this share more than its parts. This and the weight were
/// chosen on labelled sweeps of KITTI and Argoverse 2 (assets/reports/reality/frames.md).
pub const MARGIN_OF_WHOLES: f64 = 0.1;

/// The worth of clusters by what a network answers.
pub struct Rule {
    /// For each class of the network, whether it is a known one.
    is_known: Vec<bool>,
}

impl Rule {
    /// The rule for the answers of this network.
    #[must_use]
    pub fn new(classifier: &Classifier) -> Self {
        let unknown = &classifier.card().unknown_classes;
        let is_known = |class: &str| unknown.iter().all(|other| other != class);
        Self { is_known: classifier.classes().iter().map(|class| is_known(class)).collect() }
    }

    /// The worth of a cluster of `n` points: how many of them the answer explains. Without an answer,
    /// it is unknown for sure.
    #[must_use]
    pub fn worth(&self, n: usize, answer: Option<&Prediction>) -> f64 {
        let share = answer.map_or(WEIGHT_OF_UNKNOWN, |answer| {
            let known = (0..self.is_known.len()).filter(|&class| self.is_known[class]);
            let known: f64 = known.map(|class| libm::exp(answer.log_probability(class))).sum();
            let own = if answer.is_unknown { 0.0 } else { answer.confidence() };
            own.max(WEIGHT_OF_UNKNOWN * (1.0 - known))
        });
        share * n as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::Precision;
    use std::sync::Arc;

    #[test]
    fn unknown_objects_count_less_than_known_ones() {
        let rule = Rule { is_known: vec![true, false] };
        let classes: Vec<Arc<str>> = vec!["car".into(), "other".into()];
        let worth = |logits: [f32; 2]| {
            let mut answer = Prediction::empty(&classes, 1.0, Precision::F32);
            answer.class = usize::from(logits[1] > logits[0]);
            answer.is_unknown = !rule.is_known[answer.class];
            answer.logits = logits.to_vec();
            rule.worth(100, Some(&answer))
        };
        // The other class has a probability of e^-50.
        assert!((worth([50.0, 0.0]) - 100.0).abs() < 1e-9);
        assert!((worth([0.0, 50.0]) - 80.0).abs() < 1e-9);
        assert!((rule.worth(100, None) - 80.0).abs() < 1e-9);
    }
}
