//! The classes of clusters and tracks.

use std::sync::Arc;

use crate::classify::prediction::UNKNOWN;
use crate::detect;

/// Of the probability that an object is not of its class, the share of all other known classes together:
/// most false alarms are none of them.
const SHARE_OF_OTHERS: f64 = 0.2;
/// The probability that a cluster in which no object was seen is none.
const UNSEEN: f64 = 0.9;
/// Probabilities nearer to 0 count as this.
const LEAST: f64 = 1e-3;

/// The names of known classes, and of what is unknown.
pub struct Classes {
    known: Vec<Arc<str>>,
    unknown: Arc<str>,
}

/// The class and probability of a track.
pub struct Fused {
    /// The number of `resembles` among the known classes.
    pub class: usize,
    /// The name of the class, or `unknown`.
    pub answer: Arc<str>,
    /// The known class that is most likely, even if the track is unknown.
    pub resembles: Arc<str>,
    /// The probability of `resembles`.
    pub probability: f64,
}

impl Classes {
    pub fn new(known: &[String]) -> Self {
        Self {
            known: known.iter().map(|name| name.as_str().into()).collect(),
            unknown: UNKNOWN.into(),
        }
    }

    /// Their names, `unknown` being the last.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.known.iter().chain([&self.unknown]).map(|name| &**name)
    }

    /// The number of known classes, and one for what is unknown.
    pub fn n(&self) -> usize {
        self.known.len() + 1
    }

    /// The logarithms of the probabilities of the classes of a cluster, `unknown` being the last.
    pub fn view(&self, object: Option<&detect::Object>) -> Vec<f64> {
        let (mut view, n) = (vec![0.0; self.n()], self.known.len());
        let class = object.and_then(|object| {
            let class = self.known.iter().position(|name| **name == *object.class)?;
            Some((class, object.confidence))
        });
        match class {
            None => {
                view[..n].fill((1.0 - UNSEEN) / n as f64);
                view[n] = UNSEEN;
            }
            Some((class, confidence)) => {
                let others = (1.0 - confidence) * SHARE_OF_OTHERS;
                view[..n].fill(others / (n - 1).max(1) as f64);
                (view[class], view[n]) = (confidence, 1.0 - confidence - others);
            }
        }
        view.iter_mut().for_each(|value| *value = libm::log(value.max(LEAST)));
        view
    }

    /// The class of a track with these mean log-probabilities; `None` without a view.
    pub fn fused(&self, means: &[f64]) -> Option<Fused> {
        let (unknown, known) = means.split_last()?;
        let (class, largest) = known.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let sum: f64 = means.iter().map(|mean| libm::exp(mean - largest)).sum();
        let resembles = Arc::clone(&self.known[class]);
        let answer = if unknown > largest { Arc::clone(&self.unknown) } else { resembles.clone() };
        Some(Fused { class, answer, resembles, probability: 1.0 / sum })
    }
}
