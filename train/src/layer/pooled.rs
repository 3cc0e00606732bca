//! A linear layer, a batch norm and the maximum over the points of each cloud, fused.
//!
//! The products z = W x, about a thousand for each point, are never stored:
//!
//! - The maximum needs one product for each channel and cloud, which infer-cpu's fused kernel
//!   finds. A batch norm with a scale of 0 or more keeps the order of its values. A scale below 0
//!   reverses the order, so that the kernel takes weights of the opposite sign.
//! - Mean and variance of z follow from those of x: mean(z) = W mean(x), and var(z) = w cov(x) wᵀ
//!   for each channel's w.
//! - In the backward pass, the gradient G of a channel flows to one point of each cloud and,
//!   through the statistics of the batch norm, to all points. With the channel's σ and γ, the
//!   number n of all points, S = ΣG and P = ΣG ẑ over clouds:
//!
//! ```text
//! dW  =  γ/σ (Σ G x_winner  -  S mean(x)  -  P cov(x) w / σ)
//! dx  =  Σ_channels γ/σ w (G at its winners)  -  v  -  A (x - mean(x))
//! v   =  Σ_channels γ/σ S/n w,      A  =  Σ_channels γ P / (n σ²) w wᵀ
//! ```
//!
//! so that the gradient of all points takes one product with an inputs by inputs matrix.

use infer_cpu::kernel::PooledProducts;
use ndarray::parallel::prelude::*;
use ndarray::{ArrayView2, ArrayViewMut1, Axis, azip};
use rayon::slice::ParallelSliceMut;

use super::Normed;
use super::norm::{EPSILON, means, normalise};
use crate::batch::{Rows, by_cloud};
use crate::matrix::{self, Matrix};

/// The last point-wise layer before a pooling, and the pooling.
#[derive(Clone, Debug)]
pub struct PooledLayer {
    /// The parameters and the last output.
    pub base: Normed,
    relu: bool,
    saved: Saved,
}

/// The values of a forward pass that the backward pass needs.
#[derive(Clone, Debug, Default)]
struct Saved {
    /// The row with the maximum, by cloud and channel.
    winners: Vec<u32>,
    /// The product of that row, normalised to mean 0 and variance 1.
    normalised: Matrix,
    mean: Vec<f32>,
    centred: Matrix,
    /// W cov(x).
    covariant: Matrix,
    /// 1 / standard deviation of each channel.
    inverse: Vec<f32>,
}

impl PooledLayer {
    /// A layer with random weights, whose parts are named `linear` and `norm`. With `relu`, a ReLU
    /// follows.
    pub fn new(linear: &str, norm: &str, size: (usize, usize), relu: bool, seed: u64) -> Self {
        Self { base: Normed::new(linear, norm, size, seed), relu, saved: Saved::default() }
    }

    /// The row with the maximum of each channel of cloud `cloud`.
    pub fn winners(&self, cloud: usize) -> &[u32] {
        let n = self.base.output.ncols();
        &self.saved.winners[cloud * n..][..n]
    }

    /// Applies the layer to `x` `[rows, inputs]`.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        let x = x.to_owned();
        let mean = means(&x, rows.weights, rows.total);
        let centred = &x - &ndarray::aview1(&mean);
        let covariance = covariance(&centred, rows);
        let weights = self.base.linear.weight.matrix();
        // [outputs, inputs]. A covariance matrix is symmetric.
        let covariant = matrix::product(weights, covariance.t());
        let products = |row: usize| {
            let (a, w) = (covariant.row(row), weights.row(row));
            a.iter().zip(w).map(|(a, w)| f64::from(*a) * f64::from(*w)).sum::<f64>()
        };
        let variance: Vec<f32> =
            (0..weights.nrows()).map(|row| products(row).max(0.0) as f32).collect();
        let mean_product = weights.dot(&ndarray::aview1(&mean)).to_vec();
        let inverse: Vec<f32> = variance.iter().map(|v| 1.0 / (v + EPSILON).sqrt()).collect();
        let bias = &self.base.linear.bias.value;
        self.base.norm.update_statistics((&mean_product, &variance), bias, rows.total, momentum);

        let (mut normalised, winners) = self.largest(&x, rows);
        self.base.output = Matrix::zeros(normalised.dim());
        let (scale, shift) = (&self.base.norm.scale.value, &self.base.norm.shift.value);
        for (z, out) in normalised.rows_mut().into_iter().zip(self.base.output.rows_mut()) {
            normalise((z, out), [&mean_product, &inverse, scale, shift], self.relu);
        }
        self.saved = Saved { winners, normalised, mean, centred, covariant, inverse };
    }

    /// The products that the batch norm maps to the maxima, and their rows.
    fn largest(&self, x: &Matrix, rows: Rows<'_>) -> (Matrix, Vec<u32>) {
        let (inputs, outputs) = self.base.linear.size();
        let scale = &self.base.norm.scale.value;
        let sign = |c: usize| if scale[c] < 0.0 { -1.0 } else { 1.0 };
        let weights = self.base.linear.weight.matrix();
        let pooled = PooledProducts::new(inputs, outputs, |input, output| {
            sign(output) * weights[(output, input)]
        });
        let n_clouds = rows.n_clouds();
        let mut products = Matrix::zeros((n_clouds, outputs));
        let mut winners = vec![0; n_clouds * outputs];
        products
            .axis_iter_mut(Axis(0))
            .into_par_iter()
            .zip(winners.par_chunks_mut(outputs))
            .enumerate()
            .for_each(|(cloud, (mut products, winners))| {
                let (first, last) = (rows.starts[cloud], rows.starts[cloud + 1]);
                let points = x.slice(ndarray::s![first..last, ..]);
                let points = points.to_slice().expect("invariant: rows are contiguous");
                let mut maxima = vec![f32::NEG_INFINITY; outputs];
                // If all products are NaN, none is a maximum: the first row stays.
                winners.fill(first as u32);
                pooled.argmax(points, first as u32, &mut maxima, winners);
                for c in 0..outputs {
                    products[c] = sign(c) * maxima[c];
                }
            });
        (products, winners)
    }

    /// Sets the gradients of the parameters from the gradient `dy` of the output. Returns the
    /// gradient of `x` if `wants_input`.
    pub fn backward(
        &mut self,
        mut dy: Matrix,
        x: ArrayView2<'_, f32>,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        if self.relu {
            azip!((dy in &mut dy, &y in &self.base.output) if y <= 0.0 { *dy = 0.0 });
        }
        let sum = dy.sum_axis(Axis(0)).to_vec();
        let with_normalised = (&dy * &self.saved.normalised).sum_axis(Axis(0)).to_vec();
        let scale = &self.base.norm.scale.value;
        let slope: Vec<f32> = scale.iter().zip(&self.saved.inverse).map(|(s, i)| s * i).collect();
        self.weight_gradient(&dy, x, (&sum, &with_normalised), &slope);
        let dx =
            wants_input.then(|| self.input_gradient(&dy, rows, (&sum, &with_normalised), &slope));
        self.base.norm.scale.gradient.copy_from_slice(&with_normalised);
        self.base.norm.shift.gradient.copy_from_slice(&sum);
        dx
    }

    fn weight_gradient(
        &mut self,
        dy: &Matrix,
        x: ArrayView2<'_, f32>,
        (sum, with_normalised): (&[f32], &[f32]),
        slope: &[f32],
    ) {
        let Saved { winners, mean, covariant, inverse, .. } = &self.saved;
        let (inputs, outputs) = self.base.linear.size();
        let gradients = self.base.linear.weight.gradient.par_chunks_mut(inputs).enumerate();
        gradients.for_each(|(c, gradient)| {
            let mut gradient = ArrayViewMut1::from(gradient);
            let share = with_normalised[c] * inverse[c];
            azip!((gradient in &mut gradient, mean in mean, covariant in covariant.row(c)) {
                *gradient = -sum[c] * mean - share * covariant;
            });
            for (dy, winners) in dy.rows().into_iter().zip(winners.chunks_exact(outputs)) {
                gradient.scaled_add(dy[c], &x.row(winners[c] as usize));
            }
            gradient *= slope[c];
        });
    }

    fn input_gradient(
        &self,
        dy: &Matrix,
        rows: Rows<'_>,
        (sum, with_normalised): (&[f32], &[f32]),
        slope: &[f32],
    ) -> Matrix {
        let Saved { winners, centred, inverse, .. } = &self.saved;
        let (_, outputs) = self.base.linear.size();
        let weights = self.base.linear.weight.matrix();
        // A = Wᵀ (D W), D = γ P / (n σ²), and v = Wᵀ (γ/σ S/n).
        let mut curved = weights.to_owned();
        for (c, mut row) in curved.rows_mut().into_iter().enumerate() {
            row *= slope[c] * inverse[c] * with_normalised[c] / rows.total;
        }
        let a = matrix::square(curved.view(), weights);
        let shares: Vec<f32> = (0..outputs).map(|c| slope[c] * sum[c] / rows.total).collect();
        let v = weights.t().dot(&ndarray::aview1(&shares));
        let mut dx = matrix::product(centred.view(), a.t());
        for (mut dx, weight) in dx.rows_mut().into_iter().zip(rows.weights) {
            dx.zip_mut_with(&v, |dx, v| *dx = -weight * (*dx + v));
        }
        by_cloud(&mut dx, rows).into_par_iter().enumerate().for_each(|(cloud, mut dx)| {
            for c in (0..outputs).filter(|&c| dy[(cloud, c)] != 0.0) {
                let row = winners[cloud * outputs + c] as usize - rows.starts[cloud];
                dx.row_mut(row).scaled_add(dy[(cloud, c)] * slope[c], &weights.row(c));
            }
        });
        dx
    }
}

/// The weighted covariance of `centred` inputs, `[inputs, inputs]`.
fn covariance(centred: &Matrix, rows: Rows<'_>) -> Matrix {
    let mut weighted = centred.clone();
    for (mut row, weight) in weighted.rows_mut().into_iter().zip(rows.weights) {
        row *= weight / rows.total;
    }
    matrix::square(weighted.view(), centred.view())
}
