//! The pooling of a separable set abstraction (Qian et al. 2021, "ASSANet"): the maximum over the
//! neighbors of each centre comes first, and norm, ReLU and further layers follow, once for each
//! centre instead of once for each edge.
//!
//! With the features u of the points, a centre p and its neighbors q within the radius r, channel c
//! of the output is
//!
//! ```text
//! relu(norm(max over q of (a_c u_qc + v_c (q - p) / r)))
//! ```
//!
//! Row c of the weights is a_c followed by the three of v_c. A norm with a scale below 0 reverses
//! the order, so that the minimum replaces the maximum: the output is then still a maximum after the
//! norm, and the norm can be folded into the weights.

use infer_cpu::kernel::Neighborhood;
use ndarray::ArrayView2;
use ndarray::parallel::prelude::*;

use super::Normed;
use super::norm::Saved;
use crate::matrix::Matrix;
use crate::rows::{Rows, by_cloud};

/// The centres of a batch: some of the points of each cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Centres {
    /// Their coordinates.
    pub points: Vec<[f32; 3]>,
    /// The first centre of each cloud, and the end of the last cloud.
    pub starts: Vec<usize>,
    /// The weight of each centre in statistics: 1.
    weights: Vec<f32>,
}

impl Centres {
    /// Of each cloud of `points`, which begin at `starts`, those with the indices `picked`.
    #[must_use]
    pub fn new(points: &[[f32; 3]], starts: &[usize], picked: &[Vec<u32>]) -> Self {
        let mut centres = Self { starts: vec![0], ..Self::default() };
        for (picked, start) in picked.iter().zip(starts) {
            centres.points.extend(picked.iter().map(|&i| points[start + i as usize]));
            centres.starts.push(centres.points.len());
        }
        centres.weights = vec![1.0; centres.points.len()];
        centres
    }

    /// The rows of the centres.
    #[must_use]
    pub fn rows(&self) -> Rows<'_> {
        Rows::new(&self.weights, &self.starts)
    }
}

/// A pooling over the neighborhoods of centres.
#[derive(Clone, Debug)]
pub struct NeighborPool {
    /// The parameters, and the last output, `[centres, channels]`.
    pub base: Normed,
    radius: f32,
    saved: Saved,
    /// The point that each channel of each centre took.
    winners: Vec<u32>,
}

impl NeighborPool {
    /// A pooling within `radius`, whose parts are named `linear` and `norm`. At first it takes the
    /// features as they are, and random parts of the offsets.
    #[must_use]
    pub fn new(linear: &str, norm: &str, radius: f32, channels: usize, seed: u64) -> Self {
        let mut base = Normed::new(linear, norm, (4, channels), seed);
        base.linear.weight.value.iter_mut().step_by(4).for_each(|own| *own = 1.0);
        Self { base, radius, saved: Saved::default(), winners: Vec::new() }
    }

    /// The factor of the features and those of x, y and z for all channels.
    fn factors(&self) -> [Vec<f32>; 4] {
        let column = |k: usize| {
            let scale = if k == 0 { 1.0 } else { self.radius };
            self.base.linear.weight.value[k..].iter().step_by(4).map(|w| w / scale).collect()
        };
        [0, 1, 2, 3].map(column)
    }

    /// Pools the features `u` `[points, channels]` of `points`, whose clouds begin at `starts`.
    pub fn forward(
        &mut self,
        u: ArrayView2<'_, f32>,
        (points, starts): (&[[f32; 3]], &[usize]),
        centres: &Centres,
        momentum: f32,
    ) {
        let channels = u.ncols();
        let scale = &self.base.norm.scale.value;
        let signs: Vec<f32> = scale.iter().map(|&s| if s < 0.0 { -1.0 } else { 1.0 }).collect();
        let factors = self.factors();
        let pooled: Vec<(Vec<f32>, Vec<u32>)> = (0..starts.len() - 1)
            .into_par_iter()
            .map(|cloud| {
                let (first, last) = (starts[cloud], starts[cloud + 1]);
                let points = &points[first..last];
                let mut products = Vec::with_capacity(points.len() * channels);
                for (p, u) in points.iter().zip(u.rows().into_iter().skip(first)) {
                    let u = u.to_slice().expect("invariant: rows are contiguous");
                    let along = along(&factors, *p);
                    products.extend(
                        (0..channels).map(|c| signs[c] * (factors[0][c] * u[c] + along(c))),
                    );
                }
                let neighborhood = Neighborhood::of(points);
                let centres = &centres.points[centres.starts[cloud]..centres.starts[cloud + 1]];
                let mut largest = vec![f32::NEG_INFINITY; centres.len() * channels];
                let mut winners = vec![0; centres.len() * channels];
                let rows =
                    largest.chunks_exact_mut(channels).zip(winners.chunks_exact_mut(channels));
                for (&p, (largest, winners)) in centres.iter().zip(rows) {
                    for (q, _) in neighborhood.within(p, self.radius) {
                        let products = &products[q * channels..][..channels];
                        raise(largest, winners, products, (first + q) as u32);
                    }
                    let along = along(&factors, p);
                    largest.iter_mut().enumerate().for_each(|(c, x)| *x = signs[c] * *x - along(c));
                }
                (largest, winners)
            })
            .collect();
        let (largest, winners): (Vec<_>, Vec<_>) = pooled.into_iter().unzip();
        self.winners = winners.concat();
        let z = Matrix::from_shape_vec((centres.points.len(), channels), largest.concat());
        let z = z.expect("invariant: a row for each centre");
        let bias = &self.base.linear.bias.value;
        (self.base.output, self.saved) = self.base.norm.forward(z, centres.rows(), bias, momentum);
    }

    /// Sets the gradients of the parameters from the gradient `dy` of the output. Returns the
    /// gradient of `u`.
    pub fn backward(
        &mut self,
        dy: Matrix,
        u: ArrayView2<'_, f32>,
        (points, starts): (&[[f32; 3]], &[usize]),
        centres: &Centres,
    ) -> Matrix {
        let dz = self.base.norm.backward(dy, &self.base.output, &self.saved, centres.rows());
        let channels = u.ncols();
        let [own, ..] = self.factors();
        let mut du = Matrix::zeros(u.dim());
        // Only the number of each cloud's first row counts here.
        let rows = Rows::new(&[], starts);
        let by_weight: Vec<Vec<f32>> = by_cloud(&mut du, rows)
            .into_par_iter()
            .enumerate()
            .map(|(cloud, mut du)| {
                let mut gradient = vec![0.0; channels * 4];
                for centre in centres.starts[cloud]..centres.starts[cloud + 1] {
                    let p = centres.points[centre];
                    let winners = &self.winners[centre * channels..][..channels];
                    for (c, (&dz, &winner)) in dz.row(centre).iter().zip(winners).enumerate() {
                        let winner = winner as usize;
                        du[(winner - starts[cloud], c)] += dz * own[c];
                        let q = points[winner];
                        let gradient = &mut gradient[4 * c..][..4];
                        gradient[0] += dz * u[(winner, c)];
                        for k in 0..3 {
                            gradient[1 + k] += dz * (q[k] - p[k]) / self.radius;
                        }
                    }
                }
                gradient
            })
            .collect();
        for (i, gradient) in self.base.linear.weight.gradient.iter_mut().enumerate() {
            *gradient = by_weight.iter().map(|cloud| f64::from(cloud[i])).sum::<f64>() as f32;
        }
        du
    }
}

/// The product of `p` and the factors of x, y and z, by channel.
fn along<'a>([_, x, y, z]: &'a [Vec<f32>; 4], p: [f32; 3]) -> impl Fn(usize) -> f32 + 'a {
    move |c| x[c] * p[0] + y[c] * p[1] + z[c] * p[2]
}

/// Raises `largest` to `products`, and sets the winners of what is raised to `row`.
fn raise(largest: &mut [f32], winners: &mut [u32], products: &[f32], row: u32) {
    for ((largest, winner), &product) in largest.iter_mut().zip(winners).zip(products) {
        // Of equal products the first wins.
        let is_greater = product > *largest;
        *largest = if is_greater { product } else { *largest };
        *winner = if is_greater { row } else { *winner };
    }
}
