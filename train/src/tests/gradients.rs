//! Gradients, compared with finite differences of the reference network.

use std::collections::BTreeMap;

use crate::augment::{TrainingCloud, target};
use crate::batch::Batch;
use crate::batches::joined;
use crate::layer::Module;
use crate::matrix::Matrix;
use crate::recipe::{Edge, Recipe, Shape};
use crate::trainer::{MOMENTUM, Trainer};
use formats::rng::StreamKey;

use super::reference::{self, Reference, Table};

const CLASSES: usize = 4;

/// Four clouds, in two of which the first point stands for some more, with more points around each.
fn batch() -> Batch {
    let key = StreamKey::new(7, "gradients", 0);
    let mut n = 0;
    let mut point = || {
        [(); 3].map(|()| {
            n += 1;
            2.0 * key.unit(n) as f32 - 1.0
        })
    };
    let cloud = |(size, target): (usize, Vec<f32>)| {
        let points: Vec<_> = (0..size).map(|_| point()).collect();
        let neighborhood = points.iter().copied().chain((0..8).map(|_| point())).collect();
        let first_weight = if size % 3 == 0 { 4.0 } else { 1.0 };
        TrainingCloud { points, neighborhood, first_weight, target }
    };
    let one = |class: usize| target(class, CLASSES, 0.0);
    let clouds = [(5, one(1)), (3, one(2)), (6, one(3)), (4, vec![0.25, 0.0, 0.75, 0.0])];
    joined(clouds.map(cloud).into())
}

fn kept() -> Matrix {
    Matrix::from_shape_fn((4, 6), |(r, c)| if (r + 2 * c) % 4 == 0 { 0.0 } else { 1.0 / 0.6 })
}

/// The batch's clouds with each point as often as it counts.
fn duplicated(batch: &Batch) -> Vec<Table> {
    let cloud = |pair: &[usize]| {
        let rows = pair[0]..pair[1];
        let copies = |row: usize| {
            let point: Vec<f64> = batch.coordinates[row].map(f64::from).to_vec();
            std::iter::repeat_n(point, batch.weights[row] as usize)
        };
        rows.flat_map(copies).collect()
    };
    batch.starts.windows(2).map(cloud).collect()
}

fn gradients(network: &mut dyn Module) -> BTreeMap<String, Vec<f32>> {
    network.parameters().into_iter().map(|p| (p.name.clone(), p.gradient.clone())).collect()
}

fn check(shape: &Shape) {
    let batch = batch();
    let recipe = Recipe { network: shape.clone(), seed: 11, ..Recipe::default() };
    let mut network = Trainer::new(recipe, CLASSES).model;
    // Scales of either sign, and shifts that are not 0.
    let mut n = 0u32;
    for parameter in network.parameters().into_iter().filter(|p| p.name.contains("bn")) {
        for value in &mut parameter.value {
            n += 1;
            *value += 0.3 * (f64::from(n) * 1.7).sin() as f32;
            if parameter.name.ends_with("weight") && n.is_multiple_of(5) {
                *value = -*value;
            }
        }
    }
    let loss = network.learn(&batch, Some(kept()), MOMENTUM);
    let mut values = reference::values(&mut network);
    let gradients = gradients(&mut network);
    let clouds = duplicated(&batch);
    let wide = |cloud: &Vec<[f32; 3]>| cloud.iter().map(|p| p.map(f64::from).to_vec()).collect();
    let around: Vec<Table> = batch.neighborhoods.iter().map(wide).collect();
    let reference = |values: &reference::Values| {
        let around = around.clone();
        let reference = Reference { values, clouds: clouds.clone(), around, kept: Some(kept()) };
        reference.loss(shape, &batch.targets)
    };
    // Some 10 layers deep, each of fewer than 100 roundings of relative size 6e-8, magnified by
    // batch norms of four vectors.
    assert!(
        (loss.total - reference(&values)).abs() < 1e-4,
        "{} for {}",
        loss.total,
        reference(&values)
    );
    for (name, gradient) in &gradients {
        let largest = gradient.iter().fold(0.0f32, |a, g| a.max(g.abs()));
        let every = gradient.len().div_ceil(12);
        for i in (0..gradient.len()).step_by(every) {
            // Central differences: off by h² of the third derivative, and by the loss's 1e-16 / h.
            let h = 1e-5;
            let mut at = |by: f64| {
                values.get_mut(name).expect("it is there").1[i] += by;
                let loss = reference(&values);
                values.get_mut(name).expect("it is there").1[i] -= by;
                loss
            };
            let expected = (at(h) - at(-h)) / (2.0 * h);
            let found = f64::from(gradient[i]);
            let tolerance = 2e-4 + 2e-3 * f64::from(largest);
            assert!((found - expected).abs() < tolerance, "{name}[{i}]: {found} for {expected}");
        }
    }
}

#[test]
fn gradients_are_those_of_the_reference() {
    let edge = |radius, channels| Edge { radius, channels };
    for edges in [vec![], vec![edge(1.2, 5), edge(0.7, 3)]] {
        check(&Shape { edges, trunk: vec![5, 7, 11], head: vec![10, 6] });
    }
}
