//! How sure a detection is: what the bird's-eye network says of an object, and the model that is asked
//! about its points, joined by logistic regression.

use formats::model_card::ModelCard;

use crate::birdseye::Seen;
use crate::classify::classifier::Classifier;
use crate::classify::prediction::Prediction;

/// The classes that the bird's-eye network does not tell apart, because they differ in length alone.
const HEAVY: [&str; 2] = ["truck", "bus"];
/// Probabilities nearer to 0 or 1 count as these.
const NEAREST: f64 = 1e-4;

/// What the bird's-eye network's classes are to the model that is asked.
pub struct Confidence {
    classes: Vec<Class>,
}

struct Class {
    /// The classes of the model that is asked, and their names.
    of_asked: Vec<(usize, String)>,
    /// Of boxes and of clusters: a bias, the weight of the network's logit, and that of the model that is
    /// asked.
    weights: Vec<[f64; 3]>,
}

impl Confidence {
    /// By the bird's-eye network's card.
    ///
    /// # Errors
    /// A class without weights, or which `asked` does not know, in words.
    pub fn new(card: &ModelCard, asked: &Classifier) -> Result<Self, String> {
        let class = |name: &String| {
            let is_own =
                |other: &str| name == other || HEAVY.contains(&&**name) && HEAVY.contains(&other);
            let known = asked.classes().iter().enumerate().filter(|(_, other)| is_own(other));
            let of_asked: Vec<_> = known.map(|(class, name)| (class, name.to_string())).collect();
            if of_asked.is_empty() {
                return Err(format!("expected a model that knows the class `{name}` to be asked"));
            }
            let weights = card.confidence.get(name).filter(|weights| !weights.is_empty());
            let missing = || format!("metadata `confidence`: expected the weights of `{name}`");
            Ok(Class { of_asked, weights: weights.ok_or_else(missing)?.clone() })
        };
        Ok(Self { classes: card.classes.iter().map(class).collect::<Result<_, _>>()? })
    }

    /// The names of the classes.
    pub fn classes(&self) -> Vec<String> {
        let names = self.classes.iter().flat_map(|class| &class.of_asked);
        names.map(|(_, name)| name.clone()).collect()
    }

    /// Whether clusters may be of a class.
    pub fn takes_clusters(&self, class: usize) -> bool {
        self.classes[class].weights.len() > 1
    }

    /// The greatest confidence that any answer gives.
    pub fn at_most(&self, seen: &Seen, is_cluster: bool) -> f64 {
        let [bias, by_seen, by_asked] = self.classes[seen.class].weights_of(is_cluster);
        logistic(bias + by_seen * logit(f64::from(seen.score)) + by_asked.abs() * logit(1.0))
    }

    /// The name of an object's class and the confidence in it, by the network's class and score, and the
    /// answer about its points, which are those of a box or of a cluster.
    pub fn of(&self, seen: &Seen, is_cluster: bool, answer: &Prediction) -> (&str, f64) {
        let class = &self.classes[seen.class];
        let Class { of_asked, .. } = class;
        let [bias, by_seen, by_asked] = class.weights_of(is_cluster);
        let probabilities =
            of_asked.iter().map(|(class, name)| (libm::exp(answer.log_probability(*class)), name));
        let (mut sum, mut likeliest) = (0.0, (0.0, &of_asked[0].1));
        for (probability, name) in probabilities {
            sum += probability;
            if probability > likeliest.0 {
                likeliest = (probability, name);
            }
        }
        let total = bias + by_seen * logit(f64::from(seen.score)) + by_asked * logit(sum);
        (likeliest.1, logistic(total))
    }
}

impl Class {
    fn weights_of(&self, is_cluster: bool) -> [f64; 3] {
        self.weights[usize::from(is_cluster).min(self.weights.len() - 1)]
    }
}

fn logistic(logit: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-logit))
}

fn logit(probability: f64) -> f64 {
    let probability = probability.clamp(NEAREST, 1.0 - NEAREST);
    libm::log(probability / (1.0 - probability))
}

#[cfg(test)]
impl Confidence {
    /// Of classes whose clusters are taken or not.
    pub fn of_clusters(taken: &[bool]) -> Self {
        let class = |&is_taken: &bool| {
            let of_asked = vec![(0, "class".to_owned())];
            Class { of_asked, weights: vec![[0.0; 3]; if is_taken { 2 } else { 1 }] }
        };
        Self { classes: taken.iter().map(class).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::Precision;
    use std::sync::Arc;

    fn answer(logits: &[f32]) -> Prediction {
        let classes: Vec<Arc<str>> = (0..logits.len()).map(|i| format!("{i}").into()).collect();
        let mut answer = Prediction::empty(&classes, 1.0, Precision::F32);
        answer.logits = logits.to_vec();
        answer.class = (0..logits.len()).max_by(|&a, &b| logits[a].total_cmp(&logits[b])).unwrap();
        answer
    }

    /// The model that is asked knows other, truck, car and bus.
    #[test]
    fn both_answers_are_joined_and_trucks_may_be_buses() {
        let class = |of_asked: &[(usize, &str)], weights: &[[f64; 3]]| Class {
            of_asked: of_asked.iter().map(|&(at, name)| (at, name.to_owned())).collect(),
            weights: weights.to_vec(),
        };
        let seen = |class, score| Seen {
            class,
            score,
            centre_m: [0.0; 2],
            size_m: [1.0; 3],
            yaw_rad: 0.0,
        };
        let joint = Confidence {
            classes: vec![
                class(&[(2, "car")], &[[0.5, 2.0, 1.0], [0.0, 1.0, 0.0]]),
                class(&[(1, "truck"), (3, "bus")], &[[0.0, 1.0, 1.0]]),
            ],
        };
        assert_eq!(joint.classes(), ["car", "truck", "bus"]);
        let of_odds = |odds: f64| odds / (1.0 + odds);
        // Odds of 3 by the network, and of 1 to 3 by the other.
        let (name, confidence) = joint.of(&seen(0, 0.75), false, &answer(&[0.0, 0.0, 0.0, 0.0]));
        assert_eq!(name, "car");
        assert!((confidence - of_odds(0.5f64.exp() * 9.0 / 3.0)).abs() < 1e-6, "{confidence}");
        // Of 8 parts, 2 are a truck's and 4 a bus's.
        let (name, confidence) =
            joint.of(&seen(1, 0.5), false, &answer(&[0.0, 2f32.ln(), 0.0, 4f32.ln()]));
        assert_eq!(name, "bus");
        assert!((confidence - of_odds(3.0)).abs() < 1e-6, "{confidence}");
        // The first class alone has other weights for clusters.
        let even = answer(&[0.0, 0.0, 0.0, 0.0]);
        assert!((joint.of(&seen(0, 0.75), true, &even).1 - 0.75).abs() < 1e-6);
        assert_eq!(joint.of(&seen(1, 0.75), true, &even), joint.of(&seen(1, 0.75), false, &even));
        assert_eq!([0, 1].map(|class| joint.takes_clusters(class)), [true, false]);
        // What no answer exceeds, and a sure one reaches.
        let sure = joint.of(&seen(0, 0.6), false, &answer(&[0.0, 0.0, 99.0, 0.0])).1;
        assert!((joint.at_most(&seen(0, 0.6), false) - sure).abs() < 1e-9);
        assert!((joint.at_most(&seen(0, 0.6), true) - 0.6).abs() < 1e-6);
        // Certainty counts as 1 in ten thousand that it is wrong.
        let (_, confidence) = joint.of(&seen(0, 1.0), false, &answer(&[0.0, 0.0, 99.0, 0.0]));
        assert!((confidence - of_odds(0.5f64.exp() * 9999f64.powi(3))).abs() < 1e-9);
        let (_, confidence) = joint.of(&seen(0, 0.0), false, &answer(&[99.0, 0.0, 0.0, 0.0]));
        assert!(confidence > 0.0 && confidence < 1e-11, "{confidence}");
    }

    #[test]
    fn no_answer_exceeds_the_most_if_the_weight_of_answers_is_negative() {
        let of_asked = vec![(0, "car".to_owned())];
        let joint =
            Confidence { classes: vec![Class { of_asked, weights: vec![[0.0, 1.0, -1.0]] }] };
        let seen =
            Seen { class: 0, score: 0.5, centre_m: [0.0; 2], size_m: [1.0; 3], yaw_rad: 0.0 };
        let doubted = joint.of(&seen, false, &answer(&[0.0, 99.0])).1;
        assert!((joint.at_most(&seen, false) - doubted).abs() < 1e-9, "{doubted}");
    }
}
