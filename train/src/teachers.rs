//! What trained models say of the clouds of a training set, for distillation.

use crate::augment::TrainingCloud;
use crate::batch::Taught;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::predictions;
use crate::matrix::Matrix;
use crate::recipe::Distillation;
use infer_cpu::Options;

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
            let answers = predictions(path, clouds, &Options::default())?;
            for (mut shares, answer) in shares.rows_mut().into_iter().zip(&answers) {
                let logits = &answer.logits;
                if logits.len() != shares.len() {
                    let (n, found) = (shares.len(), logits.len());
                    let cause = format!("expected a teacher of {n} classes, found {found}");
                    return Err(Error::Data { path: path.clone(), cause });
                }
                let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let odds = logits.iter().map(|x| (f64::from(x - largest) / temperature).exp());
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
