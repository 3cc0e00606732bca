//! LIME-3D: which parts of a cloud determined a prediction (Tan and Kotthaus, arXiv 2107.13459;
//! their code, commit of 2021-08-17).
//!
//! The method removes parts of the cloud at random. A linear model, whose inputs say which parts
//! remain, then estimates how much each part adds to the log-probability of the class.

use formats::streams::Stream;
use infer_cpu::Classifier;
use infer_cpu::kernel;
use infer_cpu::sampler::{FarthestPoints, FpsStart};
use nalgebra::{DMatrix, DVector};

use crate::error::Error;

/// The settings of an explanation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lime {
    /// Number of parts of the cloud.
    pub clusters: usize,
    /// Number of clouds with parts removed, including the whole cloud.
    pub samples: usize,
    /// Width of the kernel that weights these clouds.
    pub sigma: f64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for Lime {
    /// The authors' settings (`lime_3d`), with LIME's default number of samples.
    fn default() -> Self {
        Self { clusters: 20, samples: 1000, sigma: 0.25, seed: 0 }
    }
}

/// Rounds of k-means.
const ROUNDS: usize = 10;

/// Weight of the ridge.
const ALPHA: f64 = 1.0;

/// The contribution of each part of a cloud to a prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The explained class: the most probable class of the whole cloud.
    pub class: usize,
    /// The part of each point.
    pub cluster: Vec<usize>,
    /// The contribution of each part to the log-probability of the class.
    pub attribution: Vec<f64>,
    /// The weighted share of variance that the linear model explains.
    pub r_squared: f64,
}

impl Explanation {
    /// The `n` points in the parts with the largest contributions, in descending order.
    #[must_use]
    pub fn strongest(&self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.cluster.len()).collect();
        let worth = |i: usize| self.attribution[self.cluster[i]];
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        order.truncate(n);
        order
    }
}

/// Explains the answer of `classifier` to `points`.
pub fn explain(
    classifier: &mut Classifier,
    points: &[[f32; 3]],
    lime: &Lime,
) -> Result<Explanation, Error> {
    let class = classifier.classify(points)?.class;
    let cluster = clusters(points, lime.clusters);
    let k = cluster.iter().max().map_or(0, |last| last + 1);
    let masks = masks(k, lime);
    let mut answers = Vec::with_capacity(masks.len());
    for mask in &masks {
        let left = points.iter().zip(&cluster).filter(|(_, part)| mask[**part]);
        let left: Vec<[f32; 3]> = left.map(|(point, _)| *point).collect();
        answers.push(classifier.classify(&left)?.log_probability(class));
    }
    let weights: Vec<f64> = masks.iter().map(|mask| weight(mask, lime.sigma)).collect();
    let (attribution, r_squared) = ridge(&masks, &answers, &weights);
    Ok(Explanation { class, cluster, attribution, r_squared })
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
            let n = own().count();
            if n == 0 {
                continue;
            }
            let mean = [0, 1, 2].map(|k| own().map(|p| p[k]).sum::<f32>() / n as f32);
            let medoid = own().min_by(|a, b| squared(a, &mean).total_cmp(&squared(b, &mean)));
            *centre = *medoid.expect("invariant: it has points");
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
fn masks(k: usize, lime: &Lime) -> Vec<Vec<bool>> {
    let stream = Stream::Lime {}.key(lime.seed);
    let mut n = 0;
    let mut masks = vec![vec![true; k]];
    while masks.len() < lime.samples {
        let mask: Vec<bool> = (0..k)
            .map(|_| {
                n += 1;
                stream.unit(n) < 0.5
            })
            .collect();
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
    let mean_of = |value: &dyn Fn(usize) -> f64| {
        weights.iter().enumerate().map(|(i, w)| w * value(i)).sum::<f64>() / total
    };
    let part = |i: usize, c: usize| f64::from(u8::from(masks[i][c]));
    let centre: Vec<f64> = (0..k).map(|c| mean_of(&|i| part(i, c))).collect();
    let level = mean_of(&|i| answers[i]);
    let x = DMatrix::from_fn(masks.len(), k, |i, c| (part(i, c) - centre[c]) * weights[i].sqrt());
    let y = DVector::from_fn(masks.len(), |i, _| (answers[i] - level) * weights[i].sqrt());
    let normal = x.tr_mul(&x) + DMatrix::identity(k, k) * ALPHA;
    let solved = normal.cholesky().map(|factor| factor.solve(&x.tr_mul(&y)));
    let coefficients = solved.expect("invariant: a ridge makes it positive definite");
    let rest = (&y - &x * &coefficients).norm_squared();
    let r_squared = 1.0 - rest / y.norm_squared().max(f64::MIN_POSITIVE);
    (coefficients.iter().copied().collect(), r_squared)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_answer_is_explained_by_its_own_coefficients() {
        let lime = Lime { samples: 4000, ..Lime::default() };
        let masks = masks(6, &lime);
        let truth = [3.0, -2.0, 0.0, 1.0, 0.5, -0.25];
        let answers: Vec<f64> = masks
            .iter()
            .map(|mask| {
                7.0 + mask.iter().zip(truth).map(|(&m, t)| f64::from(u8::from(m)) * t).sum::<f64>()
            })
            .collect();
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
        for (i, part) in cluster.iter().enumerate() {
            assert_eq!(*part, cluster[i % 3]);
        }
        assert_eq!(clusters(&points[..2], 20).len(), 2);
    }

    #[test]
    fn whole_clouds_weigh_most_and_none_is_empty() {
        let masks = masks(3, &Lime::default());
        assert_eq!(masks.len(), 1000);
        assert!(masks.iter().all(|mask| mask.contains(&true)));
        assert_eq!(weight(&[true; 4], 0.25), 1.0);
        // A quarter: d = 1/2, exp(-4)^(1/2).
        assert!((weight(&[true, false, false, false], 0.25) - (-2f64).exp()).abs() < 1e-12);
    }
}
