use std::sync::Arc;

use formats::model_card::ModelCard;

use crate::Precision;

/// The [`Prediction::answer`] for an unknown object.
pub const UNKNOWN: &str = "unknown";

/// The class of a cloud, and how it was computed.
#[derive(Debug)]
#[non_exhaustive]
pub struct Prediction {
    /// The class: an index into [`crate::Classifier::classes`]. If logits are equal, the first
    /// wins.
    pub class: usize,
    /// The name of the class, even if the object [is unknown](Prediction::is_unknown).
    pub label: Arc<str>,
    /// Whether the object belongs to no known class: its class is one of
    /// [`ModelCard::unknown_classes`].
    pub is_unknown: bool,
    /// The outputs of the network, one per class.
    pub logits: Vec<f32>,
    /// The number of points of the cloud that were not dropped.
    pub n_points: usize,
    /// The number of points that were dropped: lost returns, and those with a coordinate that is not finite.
    pub n_dropped: usize,
    /// The number of points that the network processed: those that the sampler kept, each once.
    pub n_used: usize,
    /// The precision of the computation.
    pub precision: Precision,
    /// The number of activations that were clipped to the calibrated range of int8.
    pub n_clipped: u64,
    /// The divisor of the logits before the softmax.
    temperature: f64,
}

impl Clone for Prediction {
    fn clone(&self) -> Self {
        Self { label: Arc::clone(&self.label), logits: self.logits.clone(), ..*self }
    }

    /// Copies `source` without an allocation, unless it has more classes.
    fn clone_from(&mut self, source: &Self) {
        let mut logits = std::mem::take(&mut self.logits);
        logits.clone_from(&source.logits);
        *self = Self { label: Arc::clone(&source.label), logits, ..*source };
    }
}

impl Prediction {
    pub(crate) fn empty(classes: &[Arc<str>], temperature: f64, precision: Precision) -> Self {
        Self {
            class: 0,
            label: classes.first().map_or_else(|| "".into(), Arc::clone),
            is_unknown: false,
            logits: Vec::with_capacity(classes.len()),
            n_points: 0,
            n_dropped: 0,
            n_used: 0,
            precision,
            n_clipped: 0,
            temperature,
        }
    }

    /// The answer: the class's name, or [`UNKNOWN`].
    #[must_use]
    pub fn answer(&self) -> &str {
        if self.is_unknown { UNKNOWN } else { &self.label }
    }

    /// The probability of the predicted class: the softmax of the logits at the model's
    /// temperature. For an unknown object, it is that of the class in [`Prediction::label`].
    #[must_use]
    pub fn confidence(&self) -> f64 {
        libm::exp(self.log_probability(self.class))
    }

    /// The natural logarithm of the probability of `class`.
    ///
    /// The largest logit is subtracted before the exponential, in f64, so that no finite logits
    /// overflow.
    #[must_use]
    pub fn log_probability(&self, class: usize) -> f64 {
        let largest = f64::from(self.logits[self.class]);
        let shifted = |logit: f32| (f64::from(logit) - largest) / self.temperature;
        let sum: f64 = self.logits.iter().map(|&logit| libm::exp(shifted(logit))).sum();
        shifted(self.logits[class]) - libm::log(sum)
    }
}

/// For each of these classes, whether the card says that its objects are unknown.
pub fn unknown_classes(card: &ModelCard, classes: &[Arc<str>]) -> Vec<bool> {
    let is_unknown = |class: &Arc<str>| card.unknown_classes.iter().any(|name| **name == **class);
    classes.iter().map(is_unknown).collect()
}

/// The index of the largest logit, the first one if several are equal.
pub fn argmax(logits: &[f32]) -> usize {
    let mut best = 0;
    for (class, &logit) in logits.iter().enumerate() {
        if logit > logits[best] {
            best = class;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_logits(card: &ModelCard, logits: &[f32]) -> Prediction {
        let classes: Vec<Arc<str>> = card.classes.iter().map(|name| name.as_str().into()).collect();
        let mut found = Prediction::empty(&classes, card.temperature, Precision::F32);
        found.logits = logits.to_vec();
        found.class = argmax(logits);
        found.label = Arc::clone(&classes[found.class]);
        found.is_unknown = unknown_classes(card, &classes)[found.class];
        found
    }

    #[test]
    fn unknown_is_the_answer_to_some_classes() {
        let card = ModelCard {
            classes: ["car", "tree"].map(str::to_owned).to_vec(),
            unknown_classes: vec!["tree".to_owned()],
            ..ModelCard::default()
        };
        let car = from_logits(&card, &[3.0, 1.0]);
        assert_eq!((car.answer(), car.is_unknown), ("car", false));
        let tree = from_logits(&card, &[1.0, 3.0]);
        assert_eq!((tree.answer(), &*tree.label, tree.is_unknown), ("unknown", "tree", true));
        assert_eq!(tree.confidence(), car.confidence());
    }

    #[test]
    fn temperature_makes_the_network_less_sure_and_changes_no_class() {
        let classes = vec!["a".to_owned(), "b".to_owned()];
        let card = ModelCard { classes, temperature: 2.0, ..ModelCard::default() };
        let found = from_logits(&card, &[6.0, 2.0]);
        assert_eq!(found.class, 0);
        // 1 / (1 + e^-2)
        assert!((found.confidence() - 0.880_797).abs() < 1e-6, "{}", found.confidence());
        // However large the logits are.
        let card = ModelCard { temperature: 1e-3, ..card };
        assert_eq!(from_logits(&card, &[3e38, -3e38]).confidence(), 1.0);
    }
}
