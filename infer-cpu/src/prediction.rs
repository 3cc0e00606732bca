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
    /// [`ModelCard::unknown_classes`], or its energy is above [`ModelCard::unknown_energy`].
    pub is_unknown: bool,
    /// The energy -T ln Σ exp(logit / T) at the model's temperature T: the larger it is, the less
    /// the cloud resembles the training data (Liu et al. 2020). After votes, their mean.
    pub energy: f64,
    /// The outputs of the network, one per class. After votes, mean log-probabilities.
    pub logits: Vec<f32>,
    /// The number of points of the cloud that are finite.
    pub n_points: usize,
    /// The number of points that were dropped because a coordinate was not finite.
    pub n_dropped: usize,
    /// The number of these points that were dropped as outliers.
    pub n_outliers: usize,
    /// The number of points that the network processed: those that the sampler kept, each once.
    pub n_used: usize,
    /// The precision of the computation: fp32 if the requested one overflowed on this cloud.
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
            energy: 0.0,
            logits: Vec::with_capacity(classes.len()),
            n_points: 0,
            n_dropped: 0,
            n_outliers: 0,
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

/// The rule by which an object is unknown.
pub struct UnknownRule {
    /// For each class, whether it is an unknown one.
    classes: Vec<bool>,
    energy: Option<f64>,
}

impl UnknownRule {
    pub fn new(card: &ModelCard, classes: &[Arc<str>]) -> Self {
        let is_unknown =
            |class: &Arc<str>| card.unknown_classes.iter().any(|name| **name == **class);
        Self { classes: classes.iter().map(is_unknown).collect(), energy: card.unknown_energy }
    }

    /// Whether an object of `class` with this energy is unknown.
    pub fn holds(&self, class: usize, energy: f64) -> bool {
        self.classes[class] || self.energy.is_some_and(|most| energy > most)
    }
}

/// The energy of `logits` at `temperature`: see [`Prediction::energy`]. There must be at least one
/// logit, all must be finite, and the temperature must be above 0.
#[must_use]
pub fn energy(logits: &[f32], temperature: f64) -> f64 {
    let largest = f64::from(logits[argmax(logits)]);
    let shifted = |&logit: &f32| libm::exp((f64::from(logit) - largest) / temperature);
    -largest - temperature * libm::log(logits.iter().map(shifted).sum::<f64>())
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
        found.energy = energy(logits, card.temperature);
        found.is_unknown = UnknownRule::new(card, &classes).holds(found.class, found.energy);
        found
    }

    #[test]
    fn unknown_is_the_answer_to_some_classes_and_to_high_energies() {
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
        // -ln(e^3 + e^1)
        assert!((car.energy + 3.126_928).abs() < 1e-6, "{}", car.energy);
        let strict = ModelCard { unknown_energy: Some(-3.2), ..card.clone() };
        assert_eq!(from_logits(&strict, &[3.0, 1.0]).answer(), "unknown");
        let lax = ModelCard { unknown_energy: Some(-3.1), ..card };
        assert_eq!(from_logits(&lax, &[3.0, 1.0]).answer(), "car");
    }

    #[test]
    fn temperature_makes_the_network_less_sure_and_changes_no_class() {
        let classes = vec!["a".to_owned(), "b".to_owned()];
        let card = ModelCard { classes, temperature: 2.0, ..ModelCard::default() };
        let found = from_logits(&card, &[6.0, 2.0]);
        assert_eq!(found.class, 0);
        // 1 / (1 + e^-2); -2 ln(e^3 + e^1)
        assert!((found.confidence() - 0.880_797).abs() < 1e-6, "{}", found.confidence());
        assert!((found.energy + 6.253_856).abs() < 1e-6, "{}", found.energy);
        // However large the logits are.
        assert_eq!(energy(&[3e38, -3e38], 1e-3), -f64::from(3e38f32));
    }
}
