//! What a network says about a cloud.

use std::sync::Arc;

use crate::Precision;

/// The class of a cloud, and how it was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Prediction {
    /// The class: an index into [`crate::Classifier::classes`]. Of equal
    /// logits the first wins.
    pub class: usize,
    /// The class's name.
    pub label: Arc<str>,
    /// The network's outputs, one a class. After votes, mean log-probabilities.
    pub logits: Vec<f32>,
    /// Points of the cloud, without those that were dropped.
    pub n_points: usize,
    /// Points that were dropped because a coordinate was not finite.
    pub n_dropped: usize,
    /// Points that the network saw: those that the sampler kept, each once.
    pub n_used: usize,
    /// What the network computed in: fp32 if the precision asked for
    /// overflowed on this cloud.
    pub precision: Precision,
    /// Activations that int8's calibrated ranges clipped.
    pub n_clipped: u64,
}

impl Prediction {
    /// None yet, with room for a logit of each of `classes`.
    pub(crate) fn empty(classes: &[Arc<str>], precision: Precision) -> Self {
        Self {
            class: 0,
            label: classes.first().map_or_else(|| "".into(), Arc::clone),
            logits: Vec::with_capacity(classes.len()),
            n_points: 0,
            n_dropped: 0,
            n_used: 0,
            precision,
            n_clipped: 0,
        }
    }

    /// The probability of the predicted class by the network's softmax.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.log_probability(self.class).exp()
    }

    /// The natural logarithm of class `class`'s probability.
    ///
    /// Logits are shifted by their largest before they are raised, in f64: no
    /// finite logits overflow.
    #[must_use]
    pub fn log_probability(&self, class: usize) -> f64 {
        let shifted = |logit: f32| f64::from(logit) - f64::from(self.logits[self.class]);
        let sum: f64 = self.logits.iter().map(|&logit| shifted(logit).exp()).sum();
        shifted(self.logits[class]) - sum.ln()
    }
}

/// The first of the largest.
pub fn argmax(logits: &[f32]) -> usize {
    let mut best = 0;
    for (class, &logit) in logits.iter().enumerate() {
        if logit > logits[best] {
            best = class;
        }
    }
    best
}
