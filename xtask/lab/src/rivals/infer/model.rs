//! The input of all engines, a random model and a cloud, and the checks of their answers.

use crate::measure::baseline::{STACKS, drawn};
use anyhow::{Result, ensure};
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;
use std::path::Path;

const SEED: u64 = 3;

/// The tensors of a batch norm, and the ranges that their numbers are drawn from.
const NORM: [(&str, Range<f64>); 4] = [
    ("weight", 0.8..1.2),
    ("bias", -0.1..0.1),
    ("running_mean", -0.1..0.1),
    ("running_var", 0.5..1.5),
];

pub fn write_random(file: &Path) -> Result<()> {
    let mut tensors = BTreeMap::new();
    let mut add = |name: String, shape: &[usize], range: Range<f64>| {
        let key = StreamKey::new(SEED, &name, 0);
        let number = |unit| range.start + (range.end - range.start) * unit;
        tensors.insert(name, drawn(key, shape, number));
    };
    // Inference goes without the last stack, that of a Critical Points Layer.
    for (stack, widths) in &STACKS[..6] {
        let is_conv = stack.ends_with("conv");
        // Norms of a T-Net are numbered through both of its stacks.
        let norms_before = if stack.ends_with("stn.fc") { 3 } else { 0 };
        let prefix = stack.trim_end_matches("conv").trim_end_matches("fc");
        for (i, pair) in (1..).zip(widths.windows(2)) {
            let (inputs, outputs) = (pair[0], pair[1]);
            let is_last = i + 1 == widths.len();
            // He et al. 2015: keeps the variance through ReLUs. A T-Net's last layer is
            // smaller, so that its matrix stays near the identity.
            let ends_t_net = is_last && stack.ends_with("stn.fc");
            let bound = (6.0 / inputs as f64).sqrt() * if ends_t_net { 0.02 } else { 1.0 };
            let shape = [outputs, inputs, 1];
            let shape = if is_conv { &shape[..] } else { &shape[..2] };
            add(format!("{stack}{i}.weight"), shape, -bound..bound);
            add(format!("{stack}{i}.bias"), &[outputs], -0.1..0.1);
            if is_conv || !is_last {
                for (tensor, range) in NORM {
                    add(format!("{prefix}bn{}.{tensor}", norms_before + i), &[outputs], range);
                }
            }
        }
    }
    let remark = ("note".to_owned(), "random weights, to measure speed".to_owned());
    Ok(write_weights(file, &tensors, &BTreeMap::from([remark]))?)
}

/// Radii of the torus that the points lie on; the larger sum is 1, as that of
/// a normalised cloud.
const RADII_M: [f64; 2] = [0.7, 0.3];

/// `n` points in a fixed order; a cloud of fewer is the first of them.
pub fn cloud(n: usize) -> Vec<[f32; 3]> {
    let stream = StreamKey::new(SEED, "bench infer", 0);
    let point = |i: u64| {
        let angle = |k| TAU * stream.unit(2 * i + k);
        let (around, along) = (angle(0), angle(1));
        let radius_m = RADII_M[0] + RADII_M[1] * along.cos();
        let x = [radius_m * around.cos(), radius_m * around.sin(), RADII_M[1] * along.sin()];
        x.map(|x| x as f32)
    };
    (0..n as u64).map(point).collect()
}

/// Writes `cloud` for other programs, as tensor `points`.
pub fn write_cloud(cloud: &[[f32; 3]], file: &Path) -> Result<()> {
    let points = Tensor { shape: vec![cloud.len(), 3], values: cloud.concat() };
    let tensors = BTreeMap::from([("points".to_owned(), points)]);
    Ok(write_weights(file, &tensors, &BTreeMap::new())?)
}

/// The greatest difference of `answer` from `truth`, absolute or `relative`. All numbers must be
/// finite.
pub fn worst(answer: &[f64], truth: &[f64], relative: bool) -> Result<f64> {
    let (expected, found) = (truth.len(), answer.len());
    ensure!(expected == found, "expected {expected} numbers, found {found}");
    ensure!(answer.iter().all(|x| x.is_finite()), "expected finite numbers, found {answer:?}");
    let apart = |(a, b): (&f64, &f64)| (a - b).abs() / if relative { b.abs() } else { 1.0 };
    Ok(answer.iter().zip(truth).map(apart).fold(0.0, f64::max))
}

/// The shortfall of the `keep` different points at `indices` from farthest points of `points` `[n,
/// 3]`, in that order and from the first of them on: 1 minus their squared distance over the
/// greatest there was.
pub fn shortfall(points: &[[f32; 3]], indices: &[f64], keep: usize) -> Result<f64> {
    ensure!(indices.len() == keep, "expected {keep} points, found {}", indices.len());
    let mut squared_m2 = vec![f64::INFINITY; points.len()];
    let mut worst = 0.0_f64;
    for (k, &index) in indices.iter().enumerate() {
        let index = index as usize;
        ensure!(index < points.len(), "expected a point of {}, found {index}", points.len());
        ensure!(squared_m2[index] > 0.0, "expected each point once, found {index} twice");
        if k > 0 {
            let greatest = squared_m2.iter().copied().fold(0.0, f64::max);
            worst = worst.max(1.0 - squared_m2[index] / greatest);
        }
        let chosen = points[index];
        for (squared, point) in squared_m2.iter_mut().zip(points) {
            let apart = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
            *squared = squared.min(point.iter().zip(&chosen).map(apart).sum());
        }
    }
    Ok(worst)
}

#[cfg(test)]
mod tests {
    use super::super::ours::{log_probabilities, reference};
    use super::*;

    #[test]
    fn the_random_model_tells_clouds_apart() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.safetensors");
        write_random(&file).unwrap();
        let mut network = reference(&file).unwrap();
        let flat = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let deep = [[0.0, 0.0, 1.0], [0.0, 0.5, 1.0]];
        let [flat, deep] =
            [flat, deep].map(|cloud| log_probabilities(&mut network, &cloud).unwrap());
        // Far above the tolerances of any arithmetic.
        assert!(worst(&flat, &deep, false).unwrap() > 0.1);
    }

    #[test]
    fn farthest_points_are_known_in_any_start_and_their_order_matters() {
        let line = [0.0, 1.0, 3.0, 4.0].map(|x| [x, 0.0, 0.0]);
        let fall = |indices: &[f64]| shortfall(&line, indices, indices.len());
        assert!(fall(&[0.0, 3.0, 1.0]).unwrap() < 1e-12);
        assert!(fall(&[3.0, 0.0, 2.0]).unwrap() < 1e-12);
        // 9 of 16 where the farthest was to be had.
        assert!((fall(&[0.0, 2.0]).unwrap() - 7.0 / 16.0).abs() < 1e-12);
        assert!(fall(&[0.0, 0.0]).unwrap_err().to_string().contains("found 0 twice"));
        assert!(fall(&[0.0, 9.0]).unwrap_err().to_string().contains("found 9"));
    }
}
