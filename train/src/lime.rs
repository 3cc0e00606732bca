//! LIME-3D: which parts of a cloud determined a prediction (Tan and Kotthaus, arXiv 2107.13459;
//! their code, commit of 2021-08-17).
//!
//! The method removes parts of the cloud at random. A linear model, whose inputs say which parts
//! remain, then estimates how much each part adds to the log-probability of the class.

use formats::streams::Stream;
use infer_cpu::Classifier;
use infer_cpu::kernel;
use infer_cpu::sampler::{FarthestPoints, FpsStart};

use crate::draws::Draws;
use crate::error::Error;

/// Number of clouds with parts removed, including the whole cloud: LIME's default.
pub const SAMPLES: usize = 1000;

/// Width of the kernel that weights these clouds: the authors' (`lime_3d`).
const SIGMA: f64 = 0.25;

/// Rounds of k-means.
const ROUNDS: usize = 10;

/// Weight of the ridge.
const ALPHA: f64 = 1.0;

/// The contribution of each part of a cloud to the most probable class.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The part of each point.
    pub cluster: Vec<usize>,
    /// The contribution of each part to the log-probability of the class.
    pub attribution: Vec<f64>,
    /// The weighted share of variance that the linear model explains.
    pub r_squared: f64,
}

/// Explains the answer of `classifier` to `points` by `n_parts` parts of them.
pub fn explain(
    classifier: &mut Classifier,
    points: &[[f32; 3]],
    n_parts: usize,
) -> Result<Explanation, Error> {
    let class = classifier.classify(points)?.class;
    let cluster = clusters(points, n_parts);
    let k = cluster.iter().max().map_or(0, |last| last + 1);
    let masks = masks(k, SAMPLES);
    let mut answers = Vec::with_capacity(masks.len());
    for mask in &masks {
        let left = points.iter().zip(&cluster).filter(|(_, part)| mask[**part]);
        let left: Vec<[f32; 3]> = left.map(|(point, _)| *point).collect();
        answers.push(classifier.classify(&left)?.log_probability(class));
    }
    let weights: Vec<f64> = masks.iter().map(|mask| weight(mask, SIGMA)).collect();
    let (attribution, r_squared) = ridge(&masks, &answers, &weights);
    Ok(Explanation { cluster, attribution, r_squared })
}

/// k-means whose centres are points of the cloud. The first centres are the farthest points; in
/// each round a centre moves to the point nearest to its cluster's mean.
fn clusters(points: &[[f32; 3]], k: usize) -> Vec<usize> {
    let kernels = kernel::available().next().expect("invariant: scalar kernels run everywhere");
    let mut centres = Vec::new();
    FarthestPoints::default().select(points, k, FpsStart::Farthest, kernels, &mut centres);
    let mut centres: Vec<[f32; 3]> = centres.iter().map(|&i| points[i as usize]).collect();
    let mut cluster = nearest(points, &centres);
    for _ in 0..ROUNDS {
        for (part, centre) in centres.iter_mut().enumerate() {
            let own = || points.iter().zip(&cluster).filter(|(_, c)| **c == part).map(|(p, _)| p);
            let n = own().count() as f32;
            let mean = [0, 1, 2].map(|k| own().map(|p| p[k]).sum::<f32>() / n);
            let medoid = own().min_by(|a, b| squared(a, &mean).total_cmp(&squared(b, &mean)));
            *centre = *medoid.unwrap_or(centre);
        }
        cluster = nearest(points, &centres);
    }
    cluster
}

fn nearest(points: &[[f32; 3]], centres: &[[f32; 3]]) -> Vec<usize> {
    let nearest_one = |point: &[f32; 3]| {
        let distance = |&c: &usize| squared(point, &centres[c]);
        (0..centres.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    points.iter().map(nearest_one).collect()
}

fn squared(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The parts that remain in each sample. All parts remain in the first sample, and each part
/// remains in another sample with a probability of one half. A sample without parts is drawn again.
fn masks(k: usize, n: usize) -> Vec<Vec<bool>> {
    let mut draws = Draws::new(Stream::Lime {}.key(0));
    let mut masks = vec![vec![true; k]];
    while masks.len() < n {
        let mask: Vec<bool> = (0..k).map(|_| draws.unit() < 0.5).collect();
        if mask.contains(&true) || k == 0 {
            masks.push(mask);
        }
    }
    masks
}

/// The weight √exp(-d²/σ²) of a sample at the cosine distance d from the whole cloud.
fn weight(mask: &[bool], sigma: f64) -> f64 {
    let remaining = mask.iter().filter(|remains| **remains).count() as f64;
    let distance = 1.0 - (remaining / mask.len() as f64).sqrt();
    libm::exp(-(distance / sigma).powi(2)).sqrt()
}

/// Weighted ridge regression with an intercept that is not penalised. Returns the coefficients and
/// R².
fn ridge(masks: &[Vec<bool>], answers: &[f64], weights: &[f64]) -> (Vec<f64>, f64) {
    let k = masks[0].len();
    let total: f64 = weights.iter().sum();
    // The parts and the answer of each sample. Centred columns need no intercept.
    let row = |(mask, answer): (&Vec<bool>, &f64)| {
        mask.iter().map(|&remains| f64::from(u8::from(remains))).chain([*answer]).collect()
    };
    let mut rows: Vec<Vec<f64>> = masks.iter().zip(answers).map(row).collect();
    for c in 0..=k {
        let mean = rows.iter().zip(weights).map(|(row, w)| w * row[c]).sum::<f64>() / total;
        rows.iter_mut().zip(weights).for_each(|(row, w)| row[c] = (row[c] - mean) * w.sqrt());
    }
    let mut normal = vec![vec![0.0; k + 1]; k];
    for row in &rows {
        for (normal, x) in normal.iter_mut().zip(row) {
            normal.iter_mut().zip(row).for_each(|(sum, other)| *sum += x * other);
        }
    }
    (0..k).for_each(|c| normal[c][c] += ALPHA);
    let coefficients = solve(normal);
    let modelled = |row: &[f64]| row.iter().zip(&coefficients).map(|(x, c)| x * c).sum::<f64>();
    let rest = rows.iter().map(|row| (row[k] - modelled(&row[..k])).powi(2)).sum::<f64>();
    let spread = rows.iter().map(|row| row[k].powi(2)).sum::<f64>();
    (coefficients, 1.0 - rest / spread.max(f64::MIN_POSITIVE))
}

/// The x with A x = b for `[A | b]` with a symmetric positive definite A, which needs no pivoting
/// (Gauss and Jordan).
fn solve(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let n = rows.len();
    for i in 0..n {
        let pivot = rows[i].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let factor = row[i] / pivot[i];
            row.iter_mut().zip(&pivot).for_each(|(x, pivot)| *x -= factor * pivot);
        }
    }
    rows.iter().enumerate().map(|(i, row)| row[n] / row[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_answer_is_explained_by_its_own_coefficients() {
        let masks = masks(6, 4000);
        let truth = [3.0, -2.0, 0.0, 1.0, 0.5, -0.25];
        let remaining = |mask: &Vec<bool>| {
            mask.iter().zip(truth).filter(|(remains, _)| **remains).map(|(_, t)| t).sum::<f64>()
        };
        let answers: Vec<f64> = masks.iter().map(|mask| 7.0 + remaining(mask)).collect();
        let weights: Vec<f64> = masks.iter().map(|mask| weight(mask, 10.0)).collect();
        let (found, r_squared) = ridge(&masks, &answers, &weights);
        for (found, truth) in found.iter().zip(truth) {
            // The ridge shrinks by alpha over the 1,000 of a column's squares.
            assert!((found - truth).abs() < 2e-3 * truth.abs().max(1.0), "{found}, {truth}");
        }
        assert!(r_squared > 0.999);
    }

    #[test]
    fn every_point_is_of_the_nearest_centre() {
        let mut points = Vec::new();
        for i in 0..90u8 {
            let corner = f32::from(i % 3) * 10.0;
            points.push([corner, f32::from(i) * 0.01, -corner]);
        }
        let cluster = clusters(&points, 3);
        assert!((0..90).all(|i| cluster[i] == cluster[i % 3]));
        assert_eq!(clusters(&points[..2], 20).len(), 2);
    }

    #[test]
    fn whole_clouds_weigh_most_and_none_is_empty() {
        let masks = masks(3, 1000);
        assert_eq!(masks.len(), 1000);
        assert!(masks.iter().all(|mask| mask.contains(&true)));
        assert_eq!(weight(&[true; 4], 0.25), 1.0);
        // A quarter: d = 1/2, exp(-4)^(1/2).
        assert!((weight(&[true, false, false, false], 0.25) - (-2f64).exp()).abs() < 1e-12);
    }
}
