//! The accuracy of a classifier on labelled clouds.

use formats::interval::Z;
use formats::labelled::LabelledSet;

use crate::classify::classifier::Classifier;
use crate::error::Error;

/// The confusion matrix of a classifier on a labelled set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Evaluation {
    /// The number of clouds for each label and predicted class: `[label][prediction]`.
    pub confusion: Vec<Vec<usize>>,
    /// The number of meshes, or other instances, of each label: clouds are views of them.
    pub instances: Vec<usize>,
}

/// Classifies every cloud of `set`, whose labels are indices into [`Classifier::classes`].
///
/// ```no_run
/// use std::path::Path;
///
/// use formats::labelled::read_labelled;
/// use infer_cpu::{Classifier, Options, evaluate};
///
/// let mut classifier = Classifier::load(Path::new("m.safetensors"), &Options::default())?;
/// let evaluation = evaluate(&mut classifier, &read_labelled(Path::new("test.npz"))?)?;
/// println!("{:.2} %", 100.0 * evaluation.instance_accuracy());
/// # Ok::<(), infer_cpu::Error>(())
/// ```
///
/// # Errors
/// A label without a class in the model; a cloud that cannot be classified.
pub fn evaluate(classifier: &mut Classifier, set: &LabelledSet) -> Result<Evaluation, Error> {
    let n_classes = classifier.classes().len();
    let mut confusion = vec![vec![0; n_classes]; n_classes];
    for (i, &label) in set.labels.iter().enumerate() {
        let answers = confusion.get_mut(label).ok_or(Error::UnknownLabel { label, n_classes })?;
        answers[classifier.classify_on_ground(set.cloud(i), set.ground_z(i))?.class] += 1;
    }
    Ok(Evaluation { confusion, instances: set.n_instances(n_classes) })
}

impl Evaluation {
    /// The number of clouds.
    #[must_use]
    pub fn total(&self) -> usize {
        self.confusion.iter().flatten().sum()
    }

    /// The number of correct predictions.
    #[must_use]
    pub fn correct(&self) -> usize {
        self.confusion.iter().enumerate().map(|(class, answers)| answers[class]).sum()
    }

    /// The share of correct predictions; 0 without clouds.
    #[must_use]
    pub fn instance_accuracy(&self) -> f64 {
        self.correct() as f64 / self.total().max(1) as f64
    }

    /// The mean over classes of the share of correct predictions, and the half width of its 95 %
    /// interval. Classes without clouds do not count.
    ///
    /// The interval treats the instances of each class as independent trials, but not the views of one,
    /// and adds two of each outcome (Agresti and Coull 1998), so that a class without errors does not count
    /// as certain.
    #[must_use]
    pub fn class_accuracy(&self) -> (f64, f64) {
        let classes = self.confusion.iter().enumerate().filter_map(|(class, answers)| {
            let n: usize = answers.iter().sum();
            (n > 0).then(|| (answers[class] as f64 / n as f64, self.instances[class] as f64))
        });
        let classes: Vec<(f64, f64)> = classes.collect();
        let count = classes.len().max(1) as f64;
        let mean = classes.iter().map(|(share, _)| share).sum::<f64>() / count;
        let variance = classes.iter().map(|(share, n)| {
            let share = (share * n + 2.0) / (n + 4.0);
            share * (1.0 - share) / (n + 4.0)
        });
        (mean, Z * variance.sum::<f64>().sqrt() / count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accuracies_are_shares_of_the_diagonal() {
        let confusion = vec![vec![3, 1], vec![2, 2]];
        let found = Evaluation { confusion, instances: vec![4, 4] };
        assert_eq!((found.total(), found.correct()), (8, 5));
        assert_eq!(found.instance_accuracy(), 0.625);
        assert_eq!(found.class_accuracy().0, 0.625);
        let views = Evaluation { instances: vec![1, 1], ..found.clone() };
        assert!(views.class_accuracy().1 > 1.2 * found.class_accuracy().1);
    }
}
