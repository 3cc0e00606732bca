//! A network in training, and one epoch of training.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use formats::streams::Stream;
use formats::weights::Tensor;

use crate::adam::or_zero;
use crate::batches;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::layer::Module;
use crate::matrix::Matrix;
use crate::model::{Model, Network};
use crate::model_file;
use crate::network::{PointNet, Rates};
use crate::point_encoder::PointEncoder;
use crate::recipe::Recipe;
use crate::set_network::SetNetwork;

/// The share of a batch in running statistics: PyTorch's default.
const MOMENTUM: f32 = 0.1;

/// A network in training.
#[derive(Clone, Debug)]
pub struct Trainer {
    /// The run's recipe.
    pub recipe: Recipe,
    /// The network, and its point encoder.
    pub model: Model,
    /// The number of finished steps.
    pub step: u64,
    /// The number of finished epochs.
    pub epoch: u32,
    /// The running means of weights and statistics, by name. Empty before the first step, and if the
    /// recipe averages nothing.
    pub averages: BTreeMap<String, Tensor>,
}

/// The results of an epoch so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EpochSummary {
    /// The mean loss of the batches.
    pub loss: f64,
    /// The share of augmented clouds that were classified correctly.
    pub accuracy: f64,
    /// The number of clouds.
    pub clouds: usize,
    /// The wall-clock time.
    pub time: Duration,
}

impl Trainer {
    /// A network with random weights for `n_classes` classes.
    pub fn new(recipe: Recipe, n_classes: usize) -> Result<Self, Error> {
        if !recipe.network.abstractions.is_empty() {
            let network = SetNetwork::new(&recipe.network, n_classes, recipe.seed);
            let network = Network::Sets(Box::new(network));
            return Ok(Self::of(recipe, Model { encoder: None, network }));
        }
        let network = PointNet::new(&recipe.network, n_classes, recipe.seed);
        let encoder = recipe.cpl.as_ref().map(|cpl| PointEncoder::new(cpl, n_classes, recipe.seed));
        Ok(Self::of(recipe, Model { encoder, network: Network::PointNet(Box::new(network)) }))
    }

    fn of(recipe: Recipe, model: Model) -> Self {
        Self { recipe, model, step: 0, epoch: 0, averages: BTreeMap::new() }
    }

    /// The tensors to save: the running means, or the last step's if the recipe averages nothing.
    #[must_use]
    pub fn tensors(&mut self) -> BTreeMap<String, Tensor> {
        if self.averages.is_empty() {
            return model_file::tensors(&mut self.model);
        }
        self.averages.clone()
    }

    /// Moves the running means towards the tensors after the current step: at first by more, so that
    /// the random weights of the beginning are soon forgotten.
    fn average(&mut self) {
        if self.recipe.average <= 0.0 {
            return;
        }
        let n = self.step as f64;
        let share = (1.0 - self.recipe.average).max(10.0 / (n + 9.0)) as f32;
        for (name, tensor) in model_file::tensors(&mut self.model) {
            let Some(average) = self.averages.get_mut(&name) else {
                self.averages.insert(name, tensor);
                continue;
            };
            for (average, value) in average.values.iter_mut().zip(&tensor.values) {
                *average = or_zero(*average + share * (value - *average), f32::MIN_POSITIVE);
            }
        }
    }

    /// Trains on the clouds of one epoch, except those of an incomplete last batch. Calls `report`
    /// after each step.
    pub fn learn(
        &mut self,
        clouds: &Clouds,
        mut report: impl FnMut(&EpochSummary),
    ) -> Result<EpochSummary, Error> {
        let begun = Instant::now();
        let recipe = self.recipe.clone();
        let steps = batches::count(clouds.len(), &recipe);
        let (mut loss, mut correct, mut summary) = (0.0, 0, EpochSummary::default());
        std::thread::scope(|scope| {
            let batches = batches::start(scope, clouds, &recipe, self.epoch);
            for (batch, step) in batches.iter().zip(1..) {
                let orthogonality = recipe.orthogonality as f32;
                let rates = Rates { momentum: MOMENTUM, orthogonality };
                let kept = self.dropout(recipe.batch);
                let cost = self.model.learn(&batch, kept, rates);
                if !cost.total.is_finite() {
                    return Err(self.not_finite(cost.total, step as u64));
                }
                self.step += 1;
                let progress = f64::from(self.epoch) + (step - 1) as f64 / steps as f64;
                let factor = recipe.schedule.factor(progress, recipe.epochs);
                recipe.adam.step(&mut self.model, self.step, recipe.adam.rate * factor);
                self.average();
                loss += cost.total;
                correct += cost.correct;
                let clouds = step * recipe.batch;
                summary = EpochSummary {
                    loss: loss / step as f64,
                    accuracy: correct as f64 / clouds as f64,
                    clouds,
                    time: begun.elapsed(),
                };
                report(&summary);
            }
            Ok(())
        })?;
        self.epoch += 1;
        Ok(summary)
    }

    /// The dropout mask of the last hidden features for the next step.
    fn dropout(&self, clouds: usize) -> Option<Matrix> {
        let width = self.model.network.dropout_width()?;
        let is_asked = self.recipe.dropout > 0.0;
        is_asked.then(|| dropout(&self.recipe, self.step, (clouds, width)))
    }

    fn not_finite(&mut self, loss: f64, step: u64) -> Error {
        let layer = self.model.not_finite().unwrap_or("the last").to_owned();
        Error::NotFinite { loss, step, epoch: self.epoch + 1, layer }
    }
}

/// The mask of `step`: 0 for what is dropped, and what is kept scaled to the same mean.
fn dropout(recipe: &Recipe, step: u64, (clouds, width): (usize, usize)) -> Matrix {
    let stream = Stream::Dropout {}.key(recipe.seed);
    let mut n = step * (clouds * width) as u64;
    let scale = (1.0 / (1.0 - recipe.dropout)) as f32;
    Matrix::from_shape_simple_fn((clouds, width), || {
        n += 1;
        if stream.unit(n) < recipe.dropout { 0.0 } else { scale }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_drops_its_share_of_other_features() {
        let recipe = Recipe { dropout: 0.25, ..Recipe::default() };
        let mask = |step| dropout(&recipe, step, (100, 100));
        let (first, second) = (mask(0), mask(1));
        let dropped = |mask: &Matrix| mask.iter().filter(|x| **x == 0.0).count();
        let both = first.iter().zip(&second).filter(|(a, b)| **a + **b == 0.0).count();
        // Counts of 10,000 draws, within five standard deviations of a binomial.
        for (found, share) in [(dropped(&first), 0.25), (dropped(&second), 0.25), (both, 0.0625)] {
            let off = (found as f64 - 1e4 * share).abs();
            assert!(off < 5.0 * (1e4 * share * (1.0 - share)).sqrt(), "{found} of {share}");
        }
        assert!(first.iter().all(|x| *x == 0.0 || (*x - 4.0 / 3.0).abs() < 1e-6));
    }
}
