//! What answers are compared with: the log-probabilities of the f64 network, and the
//! definition of farthest point sampling.

use anyhow::{Result, ensure};

/// How far `answer` is from `truth`: the greatest difference, or the greatest that is
/// `relative` to the true number. All numbers must be finite.
pub fn worst(answer: &[f64], truth: &[f64], relative: bool) -> Result<f64> {
    let (expected, found) = (truth.len(), answer.len());
    ensure!(expected == found, "expected {expected} numbers, found {found}");
    ensure!(answer.iter().all(|x| x.is_finite()), "expected finite numbers, found {answer:?}");
    let apart = |(a, b): (&f64, &f64)| (a - b).abs() / if relative { b.abs() } else { 1.0 };
    Ok(answer.iter().zip(truth).map(apart).fold(0.0, f64::max))
}

/// By how much the `keep` different points at `indices` fall short of being farthest
/// points of `points` `[n, 3]`, in that order and from the first of them on: 1 minus their
/// squared distance over the greatest there was.
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
    use super::super::model::write_random;
    use super::*;
    use crate::measure::reference_network::Network;

    #[test]
    fn the_random_model_tells_clouds_apart() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.safetensors");
        write_random(&file).unwrap();
        let network = Network::read(&file).unwrap();
        let flat = network.log_probabilities(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let deep = network.log_probabilities(&[[0.0, 0.0, 1.0], [0.0, 0.5, 1.0]]).unwrap();
        assert!((flat.iter().map(|x| x.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
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
