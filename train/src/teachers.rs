//! What trained models say of the clouds of a training set, for distillation.

use crate::augment::TrainingCloud;
use crate::batch::Taught;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::predictions;
use crate::matrix::Matrix;
use crate::recipe::Distillation;
use infer_cpu::{Classifier, Options};
use std::path::Path;

/// The answers of teachers to all clouds of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Teachers {
    /// The share of each class at the temperature, `[clouds, classes]`.
    shares: Matrix,
    temperature: f32,
    weight: f32,
}

impl Teachers {
    /// The mean answers of the models of `distillation` to `clouds`.
    pub fn of(distillation: &Distillation, clouds: &Clouds) -> Result<Self, Error> {
        let Distillation { teachers, temperature, weight } = distillation;
        let mut shares = Matrix::zeros((clouds.len(), clouds.classes.len()));
        for path in teachers {
            check_classes(path, &clouds.classes)?;
            let answers = predictions(path, clouds, &Options::default())?;
            for (mut shares, answer) in shares.rows_mut().into_iter().zip(&answers) {
                let logits = &answer.logits;
                let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let odds = logits.iter().map(|x| libm::exp(f64::from(x - largest) / temperature));
                let total = odds.clone().sum::<f64>() * teachers.len() as f64;
                shares
                    .iter_mut()
                    .zip(odds)
                    .for_each(|(share, odds)| *share += (odds / total) as f32);
            }
        }
        Ok(Self { shares, temperature: *temperature as f32, weight: *weight as f32 })
    }

    /// The answers to `drawn`: for a mixed cloud, the mixed answers to its parts.
    #[must_use]
    pub fn taught(&self, drawn: &[TrainingCloud]) -> Taught {
        let mut shares = Matrix::zeros((drawn.len(), self.shares.ncols()));
        for (mut shares, cloud) in shares.rows_mut().into_iter().zip(drawn) {
            for (part, share) in cloud.parts {
                shares.scaled_add(share, &self.shares.row(part));
            }
        }
        Taught { shares, temperature: self.temperature, weight: self.weight }
    }
}

/// The model at `path` must have these classes in this order.
fn check_classes(path: &Path, classes: &[String]) -> Result<(), Error> {
    let teacher = Classifier::load(path, &Options::default())?;
    let found = teacher.classes();
    let same = found.iter().zip(classes).take_while(|(found, class)| ***found == ***class).count();
    if same == classes.len() && same == found.len() {
        return Ok(());
    }
    let cause = format!(
        "expected a teacher of the {} classes of the data, in their order, found {}, of which {same} agree \
         before the first that differs",
        classes.len(),
        found.len()
    );
    Err(Error::Data { path: path.to_path_buf(), cause })
}
