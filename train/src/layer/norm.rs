//! Batch norm in training.

use ndarray::parallel::prelude::*;
use ndarray::{ArrayViewMut1, Axis};
use rayon::slice::ParallelSlice;

use super::Linear;
use crate::batch::Rows;
use crate::matrix::{Matrix, ROWS};
use crate::parameter::Parameter;

/// PyTorch's default, which the baseline uses.
pub const EPSILON: f32 = 1e-5;

/// A batch norm with its running statistics.
#[derive(Clone, Debug)]
pub struct Norm {
    /// Its name in model files.
    pub name: String,
    /// γ.
    pub scale: Parameter,
    /// β.
    pub shift: Parameter,
    /// Running mean of `W x + b`.
    pub mean: Vec<f32>,
    /// Running variance.
    pub variance: Vec<f32>,
}

/// The values of a forward pass that the backward pass needs.
#[derive(Clone, Debug, Default)]
pub struct Saved {
    /// The values, normalised to mean 0 and variance 1.
    pub normalised: Matrix,
    /// 1 / standard deviation of each channel.
    pub inverse: Vec<f32>,
}

impl Norm {
    /// A batch norm of `channels` channels.
    pub fn new(name: &str, channels: usize) -> Self {
        let parameter = |part: &str, value| {
            Parameter::new(format!("{name}.{part}"), vec![channels], vec![value; channels])
        };
        Self {
            name: name.to_owned(),
            scale: parameter("weight", 1.0),
            shift: parameter("bias", 0.0),
            mean: vec![0.0; channels],
            variance: vec![1.0; channels],
        }
    }

    /// The weights and biases of `linear` with this batch norm folded in, computed in f64 from the
    /// running statistics.
    pub fn folded_into(&self, linear: &Linear) -> (Vec<f32>, Vec<f32>) {
        let (inputs, outputs) = linear.size();
        let scale = |c: usize| {
            let variance = f64::from(self.variance[c]) + f64::from(EPSILON);
            f64::from(self.scale.value[c]) / variance.sqrt()
        };
        let weight = |i: usize| f64::from(linear.weight.value[i]) * scale(i / inputs);
        let bias = |c: usize| {
            let from_mean = f64::from(linear.bias.value[c]) - f64::from(self.mean[c]);
            from_mean * scale(c) + f64::from(self.shift.value[c])
        };
        let weights = (0..outputs * inputs).map(|i| weight(i) as f32);
        (weights.collect(), (0..outputs).map(|c| bias(c) as f32).collect())
    }

    /// Mixes the statistics of a batch into the running statistics with the share `momentum`, as
    /// PyTorch does. `mean` does not include `bias`; the variance is over `total` values.
    pub fn update_statistics(
        &mut self,
        (mean, variance): (&[f32], &[f32]),
        bias: &[f32],
        total: f32,
        momentum: f32,
    ) {
        let unbiased = total / (total - 1.0).max(1.0);
        for (channel, running) in self.mean.iter_mut().enumerate() {
            *running += momentum * (mean[channel] + bias[channel] - *running);
        }
        for (running, variance) in self.variance.iter_mut().zip(variance) {
            *running += momentum * (variance * unbiased - *running);
        }
    }

    /// The running statistics, with their names.
    pub fn statistics(&mut self) -> [(String, &mut Vec<f32>); 2] {
        let Self { name, mean, variance, .. } = self;
        [(format!("{name}.running_mean"), mean), (format!("{name}.running_var"), variance)]
    }

    /// Normalises, scales and shifts `z`, and sets negative results to 0. `z` does not include the
    /// bias, which changes only the running mean.
    pub fn forward(
        &mut self,
        mut z: Matrix,
        Rows { weights, total, .. }: Rows<'_>,
        bias: &[f32],
        momentum: f32,
    ) -> (Matrix, Saved) {
        let mean = means(&z, weights, total);
        let off = |z: f32, mean: f32| (z - mean) * (z - mean);
        let variance = column_sums(&z, weights, (&mean, off), total);
        self.update_statistics((&mean, &variance), bias, total, momentum);
        let inverse: Vec<f32> = variance.iter().map(|v| 1.0 / (v + EPSILON).sqrt()).collect();
        let (scale, shift) = (&self.scale.value, &self.shift.value);
        let mut out = Matrix::zeros(z.dim());
        z.axis_chunks_iter_mut(Axis(0), ROWS)
            .into_par_iter()
            .zip(out.axis_chunks_iter_mut(Axis(0), ROWS))
            .for_each(|(mut z, mut out)| {
                for (z, out) in z.rows_mut().into_iter().zip(out.rows_mut()) {
                    normalise((z, out), [&mean, &inverse, scale, shift], true);
                }
            });
        (out, Saved { normalised: z, inverse })
    }

    /// Sets the gradients of scale and shift from the gradient `dy` of `y`; returns that of `z`.
    pub fn backward(
        &mut self,
        mut dy: Matrix,
        y: &Matrix,
        saved: &Saved,
        Rows { weights, total, .. }: Rows<'_>,
    ) -> Matrix {
        let [sum, with_normalised] = gradient_sums(&mut dy, y, &saved.normalised);
        let Saved { normalised, inverse } = saved;
        let scale = &self.scale.value;
        dy.axis_chunks_iter_mut(Axis(0), ROWS)
            .into_par_iter()
            .zip(normalised.axis_chunks_iter(Axis(0), ROWS))
            .zip(weights.par_chunks(ROWS))
            .for_each(|((mut dy, normalised), weights)| {
                let rows = dy.rows_mut().into_iter().zip(normalised.rows());
                for ((mut dy, normalised), weight) in rows.zip(weights) {
                    let share = weight / total;
                    let normalised = normalised.to_slice().expect("invariant: rows are contiguous");
                    let sums = sum.iter().zip(&with_normalised).zip(normalised);
                    let factors = scale.iter().zip(inverse);
                    for ((dy, ((sum, with_normalised), normalised)), (scale, inverse)) in
                        slice(&mut dy).iter_mut().zip(sums).zip(factors)
                    {
                        let common = share * (sum + normalised * with_normalised);
                        *dy = scale * inverse * (*dy - common);
                    }
                }
            });
        self.scale.gradient.copy_from_slice(&with_normalised);
        self.shift.gradient.copy_from_slice(&sum);
        dy
    }
}

/// Normalises a row `z` with the mean and the inverse deviation of each channel, and writes it to
/// `out` scaled and shifted; with `relu`, negative results become 0.
pub fn normalise(
    (mut z, mut out): (ArrayViewMut1<'_, f32>, ArrayViewMut1<'_, f32>),
    [mean, inverse, scale, shift]: [&[f32]; 4],
    relu: bool,
) {
    let channels = mean.iter().zip(inverse).zip(scale.iter().zip(shift));
    let results = slice(&mut z).iter_mut().zip(slice(&mut out));
    for ((z, out), ((mean, inverse), (scale, shift))) in results.zip(channels) {
        *z = (*z - mean) * inverse;
        let y = *z * scale + shift;
        // Keeps NaN, so that the loss shows it.
        *out = if relu && y < 0.0 { 0.0 } else { y };
    }
}

fn slice<'a>(row: &'a mut ArrayViewMut1<'_, f32>) -> &'a mut [f32] {
    row.as_slice_mut().expect("invariant: rows are contiguous")
}

/// The mean of each channel of `z`, by the weights of the rows, whose sum is `total`.
pub fn means(z: &Matrix, weights: &[f32], total: f32) -> Vec<f32> {
    column_sums(z, weights, (&vec![0.0; z.ncols()], |z, _| z), total)
}

/// Sums `term(z, parameter of the channel)` times the weight of the row over all rows, and divides
/// by `total`. The sums of chunks are in f32, and the sum over chunks is in f64.
fn column_sums(
    z: &Matrix,
    weights: &[f32],
    (parameters, term): (&[f32], impl Fn(f32, f32) -> f32 + Sync),
    total: f32,
) -> Vec<f32> {
    let channels = z.ncols();
    let chunk_sums: Vec<Vec<f32>> = z
        .axis_chunks_iter(Axis(0), ROWS)
        .into_par_iter()
        .zip(weights.par_chunks(ROWS))
        .map(|(z, weights)| {
            let mut sums = vec![0.0f32; channels];
            for (z, &weight) in z.rows().into_iter().zip(weights) {
                let z = z.to_slice().expect("invariant: rows are contiguous");
                for ((sum, z), parameter) in sums.iter_mut().zip(z).zip(parameters) {
                    *sum += weight * term(*z, *parameter);
                }
            }
            sums
        })
        .collect();
    (0..channels).map(|c| (total_of(&chunk_sums, c) / f64::from(total)) as f32).collect()
}

fn total_of(chunk_sums: &[Vec<f32>], channel: usize) -> f64 {
    chunk_sums.iter().map(|sums| f64::from(sums[channel])).sum()
}

/// Applies the gradient of the ReLU to `dy`, and sums `dy` and its products with `normalised` over
/// all rows, in one pass.
fn gradient_sums(dy: &mut Matrix, y: &Matrix, normalised: &Matrix) -> [Vec<f32>; 2] {
    let channels = dy.ncols();
    let chunk_sums: Vec<Vec<f32>> = dy
        .axis_chunks_iter_mut(Axis(0), ROWS)
        .into_par_iter()
        .zip(y.axis_chunks_iter(Axis(0), ROWS))
        .zip(normalised.axis_chunks_iter(Axis(0), ROWS))
        .map(|((mut dy, y), normalised)| {
            let mut sums = vec![0.0f32; 2 * channels];
            let (sum, product) = sums.split_at_mut(channels);
            for ((mut dy, y), normalised) in
                dy.rows_mut().into_iter().zip(y.rows()).zip(normalised.rows())
            {
                let dy = slice(&mut dy);
                let y = y.to_slice().expect("invariant: rows are contiguous");
                let normalised = normalised.to_slice().expect("invariant: rows are contiguous");
                let sums = sum.iter_mut().zip(product.iter_mut());
                let values = dy.iter_mut().zip(y).zip(normalised);
                for ((sum, product), ((dy, y), normalised)) in sums.zip(values) {
                    *dy = if *y <= 0.0 { 0.0 } else { *dy };
                    *sum += *dy;
                    *product += *dy * normalised;
                }
            }
            sums
        })
        .collect();
    [0, channels]
        .map(|first| (first..first + channels).map(|c| total_of(&chunk_sums, c) as f32).collect())
}
