//! The proportions of classes overlap, but their shapes differ.

use rayon::prelude::*;

use super::descriptors::{aspect_ratios, height_profile, shape_distribution};
use super::{SEED, ShapeClass, generate};
use sim_gpu::internals::mesh::TriangleMesh;

const TRAIN: u32 = 40;
const TEST: u32 = 20;

/// The fraction of test shapes whose nearest training shape, by the Euclidean distance of
/// `describe`, is of the same class.
fn accuracy(describe: impl Fn(&TriangleMesh) -> Vec<f64> + Sync) -> f64 {
    let described: Vec<Vec<(ShapeClass, Vec<f64>)>> = [0..TRAIN, TRAIN..TRAIN + TEST]
        .into_iter()
        .map(|instances| {
            let all: Vec<_> =
                ShapeClass::ALL.iter().flat_map(|c| instances.clone().map(|k| (*c, k))).collect();
            all.into_par_iter().map(|(c, k)| (c, describe(&generate(c, SEED, k)))).collect()
        })
        .collect();
    let [train, test] = [&described[0], &described[1]];
    let right = test.iter().filter(|(class, d)| nearest(train, d) == Some(*class)).count();
    right as f64 / test.len() as f64
}

fn nearest(train: &[(ShapeClass, Vec<f64>)], to: &[f64]) -> Option<ShapeClass> {
    let distance = |d: &[f64]| d.iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    train.iter().min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1))).map(|(class, _)| *class)
}

#[test]
fn proportions_alone_do_not_tell_the_classes_apart_but_shapes_do() {
    let ratios = accuracy(aspect_ratios);
    let distribution = accuracy(shape_distribution);
    let all = accuracy(|mesh| {
        [aspect_ratios(mesh), shape_distribution(mesh), height_profile(mesh)].concat()
    });
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
    for class in ShapeClass::ALL {
        let described: Vec<Vec<f64>> = (0..TRAIN)
            .into_par_iter()
            .map(|k| generate(class, SEED, k))
            .map(|mesh| [aspect_ratios(&mesh), height_profile(&mesh)].concat())
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
