//! Which cut of a sweep is taken: the one that its answers explain best.

use infer_cpu::{Classifier, Prediction};

/// How much an unknown object counts beside a known one of the same probability.
const WEIGHT_OF_UNKNOWN: f64 = 0.8;

/// By which share a cluster must be worth more than its parts not to be divided.
///
/// Both were chosen on 14 labelled sweeps of KITTI and Argoverse 2, on which neighbouring values
/// (0.7 to 0.9, 0.05 to 0.15) find 54 to 59 of 72 cars and persons.
pub const MARGIN_OF_WHOLES: f64 = 0.1;

/// Clusters with a larger diagonal are no object, metres: an articulated bus is 18 m long and 2.55 m
/// wide.
pub const WIDEST_M: f32 = 20.0;

/// The worth of clusters by what a network answers.
pub struct Rule {
    /// For each class of the network, whether it is a known one.
    is_known: Vec<bool>,
}

impl Rule {
    pub fn new(classifier: &Classifier) -> Self {
        let unknown = &classifier.card().unknown_classes;
        let is_known = |class: &str| unknown.iter().all(|other| other != class);
        Self { is_known: classifier.classes().iter().map(|class| is_known(class)).collect() }
    }

    /// The worth of a cluster of `n` points: how many of them the answer explains. Without an answer,
    /// it is unknown for sure.
    pub fn worth(&self, n: usize, answer: Option<&Prediction>) -> f64 {
        let share = answer.map_or(WEIGHT_OF_UNKNOWN, |answer| {
            let known = (0..self.is_known.len()).filter(|&class| self.is_known[class]);
            let known: f64 = known.map(|class| answer.log_probability(class).exp()).sum();
            let own = if answer.is_unknown { 0.0 } else { answer.confidence() };
            own.max(WEIGHT_OF_UNKNOWN * (1.0 - known))
        });
        share * n as f64
    }
}
