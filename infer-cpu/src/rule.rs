//! Which cut of a hierarchy is taken: the one that its answers explain best.

use crate::classifier::Classifier;
use crate::prediction::Prediction;

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
        // An answer that is unknown by its energy says nothing about the classes.
        let certain = |answer: &&Prediction| !(answer.is_unknown && self.is_known[answer.class]);
        let share = answer.filter(certain).map_or(WEIGHT_OF_UNKNOWN, |answer| {
            let known = (0..self.is_known.len()).filter(|&class| self.is_known[class]);
            let known: f64 = known.map(|class| libm::exp(answer.log_probability(class))).sum();
            let own = if answer.is_unknown { 0.0 } else { answer.confidence() };
            own.max(WEIGHT_OF_UNKNOWN * (1.0 - known))
        });
        share * n as f64
    }
}
