//! A network in training, and one epoch of training.

use std::time::Instant;

use formats::streams::Stream;

use crate::adam;
use crate::batches;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::layer::Module;
use crate::matrix::Matrix;
use crate::metrics::Epoch;
use crate::model::Model;
use crate::network::PointNet;
use crate::point_encoder::PointEncoder;
use crate::recipe::Recipe;

/// The share of a batch in running statistics: PyTorch's default.
pub const MOMENTUM: f32 = 0.1;

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
}

impl Trainer {
    /// A network with random weights for `n_classes` classes.
    pub fn new(recipe: Recipe, n_classes: usize) -> Self {
        let network = PointNet::new(&recipe.network, n_classes, recipe.seed);
        let encoder = recipe.cpl.as_ref().map(|cpl| PointEncoder::new(cpl, n_classes, recipe.seed));
        Self { recipe, model: Model { encoder, network }, step: 0, epoch: 0 }
    }

    /// Trains on the clouds of one epoch, except those of an incomplete last batch.
    pub fn learn(&mut self, clouds: &Clouds) -> Result<Epoch, Error> {
        let begun = Instant::now();
        let recipe = self.recipe.clone();
        let steps = batches::count(clouds.len(), &recipe);
        let dropped = recipe.network.head.last().filter(|_| recipe.dropout > 0.0);
        let (mut loss, mut correct) = (0.0, 0);
        std::thread::scope(|scope| {
            let batches = batches::start(scope, clouds, &recipe, self.epoch)?;
            for (batch, step) in batches.iter().zip(1..) {
                let kept = dropped.map(|width| dropout(&recipe, self.step, (recipe.batch, *width)));
                let cost = self.model.learn(&batch, kept, MOMENTUM);
                if !cost.total.is_finite() {
                    let layer = self.model.not_finite().unwrap_or("the last").to_owned();
                    let (loss, epoch) = (cost.total, self.epoch + 1);
                    return Err(Error::NotFinite { loss, step, epoch, layer });
                }
                self.step += 1;
                let done = (step - 1) as f64 / steps as f64;
                adam::step(&mut self.model, self.step, rate(&recipe, self.epoch, done));
                loss += cost.total;
                correct += cost.correct;
            }
            Ok(())
        })?;
        let rate = rate(&recipe, self.epoch, 0.0);
        self.epoch += 1;
        let n = (steps * recipe.batch) as f64;
        let seconds = begun.elapsed().as_secs_f64();
        Ok(Epoch {
            epoch: self.epoch,
            rate,
            loss: loss / steps as f64,
            accuracy: correct as f64 / n,
            validation_instance: None,
            validation_class: None,
            seconds,
            clouds_per_second: n / seconds,
        })
    }
}

/// The learning rate after a part of an epoch, from 0 to 1, where `epoch` are finished.
fn rate(recipe: &Recipe, epoch: u32, part: f64) -> f64 {
    recipe.rate * recipe.schedule.factor(f64::from(epoch) + part, recipe.epochs)
}

/// The dropout mask of the last hidden features in `step`: 0 for what is dropped, and what is kept
/// scaled to the same mean.
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
    use crate::recipe_tables::Schedule;

    /// Half of the cosine is over in the middle of the fourth of six epochs, the first of which warms up.
    #[test]
    fn the_rate_follows_the_schedule_within_an_epoch() {
        let schedule = Schedule::Cosine { warm_up: 1.0 };
        let recipe = Recipe { schedule, rate: 2.0, epochs: 6, ..Recipe::default() };
        let expected = [(0, 0.5, 0.51), (1, 0.0, 1.0), (3, 0.5, 0.505), (6, 0.0, 0.01)];
        for (epoch, part, factor) in expected {
            assert!((rate(&recipe, epoch, part) - 2.0 * factor).abs() < 1e-12, "{epoch} {part}");
        }
    }

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
