//! Gradients, compared with finite differences of the reference network.

use std::collections::BTreeMap;

use formats::rng::StreamKey;
use train::batch::Batch;
use train::layer::Module;
use train::matrix::Matrix;
use train::network::Rates;
use train::recipe::Recipe;
use train::shape::{Abstraction, Edge, Shape};
use train::trainer::Trainer;

use crate::reference::{self, Reference, Table};

const RATES: Rates = Rates { momentum: 0.1, orthogonality: 0.02 };

fn shape(input_transform: bool, feature_transform: bool) -> Shape {
    Shape {
        input_transform,
        feature_transform,
        trunk: vec![5, 7, 11],
        t_net: vec![6, 9],
        t_net_head: vec![8],
        head: vec![10, 6],
        ..Shape::default()
    }
}

const CLASSES: usize = 4;

/// Four clouds, in two of which the first point stands for some more.
fn batch() -> Batch {
    let key = StreamKey::new(7, "gradients", 0);
    let mut n = 0;
    let mut unit = || {
        n += 1;
        key.unit(n) as f32
    };
    let sizes = [5, 3, 6, 4];
    let mut batch = Batch { starts: vec![0], ..Batch::default() };
    for size in sizes {
        for point in 0..size {
            batch.coordinates.push([(); 3].map(|()| 2.0 * unit() - 1.0));
            let stands_for_more = point == 0 && size % 3 == 0;
            batch.weights.push(if stands_for_more { 4.0 } else { 1.0 });
        }
        batch.starts.push(batch.coordinates.len());
    }
    // Around each cloud, its own points and some more.
    batch.neighborhood_starts.push(0);
    for cloud in 0..sizes.len() {
        batch.neighborhood.extend(&batch.coordinates[batch.starts[cloud]..batch.starts[cloud + 1]]);
        batch.neighborhood.extend((0..8).map(|_| [(); 3].map(|()| 2.0 * unit() - 1.0)));
        batch.neighborhood_starts.push(batch.neighborhood.len());
    }
    batch.targets = Matrix::from_shape_fn((sizes.len(), CLASSES), |(cloud, class)| {
        // One cloud's target is shared between classes.
        match (cloud, class) {
            (3, 0) => 0.25,
            (3, 2) => 0.75,
            (3, _) => 0.0,
            _ => f32::from(u8::from(class == (cloud + 1) % CLASSES)),
        }
    });
    batch
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
    let mut network = Trainer::new(recipe, CLASSES).unwrap().model;
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
    let loss = network.learn(&batch, Some(kept()), RATES);
    let mut values = reference::values(&mut network);
    let gradients = gradients(&mut network);
    let clouds = duplicated(&batch);
    let wide = |cloud| batch.neighborhood_of(cloud).iter().map(|p| p.map(f64::from).to_vec());
    let around: Vec<Table> = (0..batch.len()).map(|cloud| wide(cloud).collect()).collect();
    let reference = |values: &reference::Values| {
        let around = around.clone();
        let reference = Reference { values, clouds: clouds.clone(), around, kept: Some(kept()) };
        reference.loss(shape, &batch.targets, RATES.orthogonality)
    };
    // Some 30 layers deep, each of fewer than 100 roundings of relative size 6e-8, magnified by
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
fn gradients_of_edge_convolutions_are_those_of_the_reference() {
    let edge = |radius, channels| Edge { radius, channels };
    for input_transform in [false, true] {
        let edges = vec![edge(1.2, 5), edge(0.7, 3)];
        check(&Shape { edges, ..shape(input_transform, false) });
    }
}

#[test]
fn gradients_of_set_abstractions_are_those_of_the_reference() {
    let abstraction = |centres, radius, widths| Abstraction { centres, radius, widths };
    let one = vec![abstraction(4, 1.2, vec![6, 9])];
    let two = [one.clone(), vec![abstraction(2, 1.7, vec![8])]].concat();
    for abstractions in [one, two] {
        check(&Shape { abstractions, ..shape(false, false) });
    }
}

#[test]
fn gradients_with_and_without_t_nets_are_those_of_the_reference() {
    for [input_transform, feature_transform] in
        [[true, true], [false, true], [true, false], [false, false]]
    {
        println!("T-Nets of coordinates and features: {input_transform}, {feature_transform}");
        check(&shape(input_transform, feature_transform));
    }
}
