//! The batches of an epoch, which other threads prepare in advance.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{Builder, Scope};

use formats::rng::StreamKey;
use formats::streams::Stream;
use rayon::prelude::*;

use crate::augment::{TrainingCloud, augment};
use crate::batch::Batch;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::matrix::Matrix;
use crate::recipe::Recipe;

/// Largest number of prepared batches that wait for the network.
const AHEAD: usize = 3;

/// The number of complete batches in an epoch of a set of `n` clouds.
pub fn count(n: usize, recipe: &Recipe) -> usize {
    recipe.clouds_per_epoch.unwrap_or(n) / recipe.batch
}

/// Starts preparing the batches of `epoch`, in an order that depends on the seed and the epoch.
pub fn start<'s>(
    scope: &'s Scope<'s, '_>,
    clouds: &'s Clouds,
    recipe: &'s Recipe,
    epoch: u32,
) -> Result<Receiver<Batch>, Error> {
    let (sender, receiver) = sync_channel(AHEAD);
    let prepare = move || {
        let order = order(&clouds.set.labels, clouds.classes.len(), epoch, recipe);
        for some in order.chunks_exact(recipe.batch) {
            let draw = |&(i, turn): &(usize, u32)| augment(clouds, i, (epoch, turn), recipe);
            let drawn: Vec<TrainingCloud> = some.par_iter().map(draw).collect();
            if sender.send(joined(drawn)).is_err() {
                // The receiver has stopped after an error.
                break;
            }
        }
    };
    Builder::new().spawn_scoped(scope, prepare).map_err(Error::Thread)?;
    Ok(receiver)
}

/// The clouds of an epoch in random order, each with the number of its earlier draws. With
/// `balance`, the share of a class of n clouds is in proportion to n^(1 - balance), give or take
/// one cloud.
fn order(labels: &[usize], n_classes: usize, epoch: u32, recipe: &Recipe) -> Vec<(usize, u32)> {
    let all = 0..labels.len();
    let groups: Vec<Vec<usize>> = if recipe.balance > 0.0 {
        let members = |class| all.clone().filter(|&i| labels[i] == class).collect();
        (0..n_classes).map(members).filter(|group: &Vec<usize>| !group.is_empty()).collect()
    } else {
        vec![all.collect()]
    };
    let weight = |group: &Vec<usize>| libm::pow(group.len() as f64, 1.0 - recipe.balance);
    let total: f64 = groups.iter().map(weight).sum();
    let size = recipe.clouds_per_epoch.unwrap_or(labels.len());
    let mut order = Vec::with_capacity(size);
    let mut weighed = 0.0;
    for (number, group) in groups.iter().enumerate() {
        weighed += weight(group);
        // Rounds the total of the groups up to this one, so that all groups have `size`.
        let share = (size as f64 * weighed / total).round() as usize - order.len();
        for turn in 0..share / group.len() {
            order.extend(group.iter().map(|&i| (i, turn as u32)));
        }
        let mut group = group.clone();
        shuffle(&mut group, Stream::Rest { group: number, epoch }.key(recipe.seed));
        let turn = (share / group.len()) as u32;
        order.extend(group.iter().take(share % group.len()).map(|&i| (i, turn)));
    }
    shuffle(&mut order, Stream::Order { epoch }.key(recipe.seed));
    order
}

/// The shuffle of Fisher and Yates.
fn shuffle<T>(values: &mut [T], stream: StreamKey) {
    for i in (1..values.len()).rev() {
        values.swap(i, stream.below(i as u64 + 1, i as u64) as usize);
    }
}

/// Joins clouds to one batch.
pub fn joined(drawn: Vec<TrainingCloud>) -> Batch {
    let n_classes = drawn.first().map_or(0, |cloud| cloud.target.len());
    let targets = drawn.iter().flat_map(|cloud| cloud.target.iter().copied()).collect();
    let targets = Matrix::from_shape_vec((drawn.len(), n_classes), targets)
        .expect("invariant: every target has all classes");
    let mut batch = Batch { starts: vec![0], targets, ..Batch::default() };
    for cloud in drawn {
        batch.coordinates.extend(&cloud.points);
        batch.weights.push(cloud.first_weight);
        batch.weights.resize(batch.coordinates.len(), 1.0);
        batch.starts.push(batch.coordinates.len());
        batch.neighborhoods.push(cloud.neighborhood);
    }
    batch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_balanced_epoch_has_as_many_clouds_of_each_class() {
        let labels = [0, 0, 0, 1, 0, 0, 0, 0];
        let recipe = Recipe { balance: 1.0, clouds_per_epoch: Some(11), ..Recipe::default() };
        let mut drawn = order(&labels, 3, 5, &recipe);
        assert_eq!(drawn, order(&labels, 3, 5, &recipe));
        assert_ne!(drawn, order(&labels, 3, 6, &recipe));
        drawn.sort_unstable();
        assert_eq!(drawn.iter().filter(|(i, _)| *i == 3).count(), 5);
        assert_eq!(drawn.len(), 11);
        // No draw comes twice: each has random numbers of its own.
        assert!(drawn.windows(2).all(|pair| pair[0] != pair[1]), "{drawn:?}");
        // Halfway, the square roots of 7 and 1 share the eleven.
        let drawn = order(&labels, 3, 5, &Recipe { balance: 0.5, ..recipe.clone() });
        assert_eq!(drawn.iter().filter(|(i, _)| *i == 3).count(), 3);
        assert_eq!(drawn.len(), 11);
        assert_eq!(count(8, &Recipe { batch: 4, ..recipe }), 2);
    }

    #[test]
    fn an_epoch_has_each_cloud_once_and_a_short_one_others_each_time() {
        let drawn = |clouds_per_epoch, epoch| {
            let recipe = Recipe { clouds_per_epoch, ..Recipe::default() };
            let mut drawn = order(&[0; 30], 1, epoch, &recipe);
            assert!(!drawn.is_sorted());
            drawn.sort_unstable();
            drawn
        };
        assert_eq!(drawn(None, 0), (0..30).map(|i| (i, 0)).collect::<Vec<_>>());
        let [first, second] = [0, 1].map(|epoch| drawn(Some(11), epoch));
        assert_eq!((first.len(), second.len()), (11, 11));
        assert_ne!(first, second);
    }
}
