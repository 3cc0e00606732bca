//! An epoch's batches, prepared in advance on other threads.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::Scope;

use formats::rng::StreamKey;
use rayon::prelude::*;

use crate::augment::{TrainingCloud, augment};
use crate::batch::Batch;
use crate::clouds::Clouds;
use crate::matrix::Matrix;
use crate::recipe::Recipe;

/// Prepared batches that wait for the network, at most.
const AHEAD: usize = 3;

/// How many whole batches `n` clouds make.
#[must_use]
pub fn count(n: usize, recipe: &Recipe) -> usize {
    n / recipe.batch
}

/// The batches of `epoch`, in an order that depends on seed and epoch.
pub fn start<'s>(
    scope: &'s Scope<'s, '_>,
    clouds: &'s Clouds,
    recipe: &'s Recipe,
    epoch: u32,
) -> Receiver<Batch> {
    let (sender, receiver) = sync_channel(AHEAD);
    scope.spawn(move || {
        let order = order(clouds.len(), epoch, recipe);
        for some in order.chunks_exact(recipe.batch) {
            let drawn: Vec<TrainingCloud> =
                some.par_iter().map(|&i| augment(clouds, i, epoch, recipe)).collect();
            if sender.send(joined(&drawn)).is_err() {
                // The receiver has stopped after an error.
                break;
            }
        }
    });
    receiver
}

/// A permutation of `n` clouds (Fisher and Yates).
fn order(n: usize, epoch: u32, recipe: &Recipe) -> Vec<usize> {
    let stream = StreamKey::new(recipe.seed, "order", epoch);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, stream.below(i as u64 + 1, i as u64) as usize);
    }
    order
}

/// One batch of some clouds.
#[must_use]
pub fn joined(drawn: &[TrainingCloud]) -> Batch {
    let n_classes = drawn.first().map_or(0, |cloud| cloud.target.len());
    let mut batch = Batch { starts: vec![0], neighborhood_starts: vec![0], ..Batch::default() };
    for cloud in drawn {
        batch.coordinates.extend(&cloud.points);
        batch.weights.push(cloud.first_weight);
        batch.weights.resize(batch.coordinates.len(), 1.0);
        batch.starts.push(batch.coordinates.len());
        batch.neighborhood.extend(&cloud.neighborhood);
        batch.neighborhood_starts.push(batch.neighborhood.len());
    }
    let targets = drawn.iter().flat_map(|cloud| cloud.target.iter().copied()).collect();
    batch.targets = Matrix::from_shape_vec((drawn.len(), n_classes), targets)
        .expect("invariant: every target has all classes");
    batch
}
