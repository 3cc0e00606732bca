//! Accuracy, measured by infer-cpu itself: what is reported is what runs.

use std::path::Path;

use formats::interval::Z;
use infer_cpu::{Classifier, Options};
use rayon::prelude::*;

use crate::clouds::Clouds;
use crate::error::Error;

/// Clouds that one classifier takes.
const CHUNK: usize = 128;

/// Right and wrong answers by class: `[class][answer]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Confusion(pub Vec<Vec<usize>>);

impl Confusion {
    /// How many clouds there are.
    #[must_use]
    pub fn total(&self) -> usize {
        self.0.iter().flatten().sum()
    }

    /// How many were recognised.
    #[must_use]
    pub fn correct(&self) -> usize {
        self.0.iter().enumerate().map(|(class, answers)| answers[class]).sum()
    }

    /// The share of clouds that were recognised.
    #[must_use]
    pub fn instance_accuracy(&self) -> f64 {
        self.correct() as f64 / self.total().max(1) as f64
    }

    /// The mean over classes that have clouds of the share recognised, and the
    /// half width of its 95 % interval: each class's share is one of
    /// independent trials, Agresti and Coull's (1998) two of each outcome
    /// added, so that a class without errors is not taken for one that never
    /// errs.
    #[must_use]
    pub fn class_accuracy(&self) -> (f64, f64) {
        let classes = self.0.iter().enumerate().filter_map(|(class, answers)| {
            let n: usize = answers.iter().sum();
            (n > 0).then(|| (answers[class] as f64, n as f64))
        });
        let classes: Vec<(f64, f64)> = classes.collect();
        let count = classes.len().max(1) as f64;
        let mean = classes.iter().map(|(right, n)| right / n).sum::<f64>() / count;
        let variance = classes.iter().map(|(right, n)| {
            let share = (right + 2.0) / (n + 4.0);
            share * (1.0 - share) / (n + 4.0)
        });
        (mean, Z * variance.sum::<f64>().sqrt() / count)
    }
}

/// Lets the model at `path` classify all of `clouds`.
///
/// # Errors
/// What infer-cpu refuses.
pub fn confusion(path: &Path, clouds: &Clouds, options: &Options) -> Result<Confusion, Error> {
    let indices: Vec<usize> = (0..clouds.len()).collect();
    let answers: Vec<Vec<usize>> = indices
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut classifier = Classifier::load(path, options)?;
            let answer = |&i: &usize| Ok(classifier.classify(clouds.set.cloud(i))?.class);
            chunk.iter().map(answer).collect::<Result<_, Error>>()
        })
        .collect::<Result<_, Error>>()?;
    let n = clouds.classes.len();
    if let Some(answer) = answers.iter().flatten().find(|&&answer| answer >= n) {
        let cause = format!("answers class {answer}, the clouds have {n}");
        return Err(Error::Data { path: path.to_path_buf(), cause });
    }
    let mut confusion = vec![vec![0; n]; n];
    for (label, answer) in clouds.set.labels.iter().zip(answers.into_iter().flatten()) {
        confusion[*label][answer] += 1;
    }
    Ok(Confusion(confusion))
}
