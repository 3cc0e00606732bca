//! The proportions of classes overlap, but their shapes differ.

use rayon::prelude::*;

use super::descriptors::{aspect_ratios, height_profile, shape_distribution};
use super::{SEED, ShapeClass, generate};
use std::ops::Range;
use std::sync::LazyLock;

const TRAIN: u32 = 40;
const TEST: u32 = 20;

/// The aspect ratios, the distribution D2 and the height profile of a shape.
type Described = (ShapeClass, [Vec<f64>; 3]);

/// [`TRAIN`] shapes of each class, and [`TEST`] others.
static DESCRIBED: LazyLock<[Vec<Described>; 2]> = LazyLock::new(|| {
    [0..TRAIN, TRAIN..TRAIN + TEST].map(|instances| {
        let of = |(class, k)| {
            let mesh = generate(class, SEED, k);
            (class, [aspect_ratios(&mesh), shape_distribution(&mesh), height_profile(&mesh)])
        };
        let all: Vec<_> =
            ShapeClass::ALL.iter().flat_map(|c| instances.clone().map(|k| (*c, k))).collect();
        all.into_par_iter().map(of).collect()
    })
});

/// The fraction of test shapes whose nearest training shape, by the Euclidean distance of some
/// descriptors, is of the same class.
fn accuracy(descriptors: Range<usize>) -> f64 {
    let [train, test] = DESCRIBED.each_ref().map(|shapes| -> Vec<(ShapeClass, Vec<f64>)> {
        let chosen = |(class, all): &Described| (*class, all[descriptors.clone()].concat());
        shapes.iter().map(chosen).collect()
    });
    let right = test.iter().filter(|(class, d)| nearest(&train, d) == Some(*class)).count();
    right as f64 / test.len() as f64
}

fn nearest(train: &[(ShapeClass, Vec<f64>)], to: &[f64]) -> Option<ShapeClass> {
    let distance = |d: &[f64]| d.iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    train.iter().min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1))).map(|(class, _)| *class)
}

#[test]
fn proportions_alone_do_not_tell_the_classes_apart_but_shapes_do() {
    let [ratios, distribution, all] = [0..1, 1..2, 0..3].map(accuracy);
    println!("aspect ratios {ratios:.3}, D2 {distribution:.3}, with the height profile {all:.3}");
    // Guessing gives 0.1. The standard deviation of a fraction of 200 tests is at most 0.035. The
    // bounds are about three of these from the measured values, so that new makes of a class do not
    // fail the test, but a class that is trivial or like another one does.
    assert!(ratios < 0.75, "aspect ratios alone are right in {ratios}");
    assert!(distribution > 0.4, "D2 is right in only {distribution}");
    assert!(all > 0.6 && all < 0.97, "descriptors are right in {all}");
    assert!(all > ratios + 0.05, "shape adds nothing to proportions");
}

#[test]
fn no_two_instances_of_a_class_are_alike() {
    for of_class in DESCRIBED[0].chunk_by(|a, b| a.0 == b.0) {
        let class = of_class[0].0;
        let described: Vec<Vec<f64>> = of_class
            .iter()
            .map(|(_, [ratios, _, profile])| [&ratios[..], profile].concat())
            .collect();
        for (i, a) in described.iter().enumerate() {
            for b in &described[..i] {
                let largest = a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                // The square root of a share deviates by up to four standard deviations, 0.5 /
                // sqrt(8000), between two samples of one shape: 0.02.
                assert!(largest > 0.02, "{class}: {i} is like another: {largest}");
            }
        }
    }
}
