//! A network of set abstractions: point-wise layers, then levels of fewer and fewer centres with
//! wider and wider neighborhoods, then the maximum and the mean over the last level.

use infer_cpu::sampler::{FarthestPoints, FpsStart};
use ndarray::{ArrayView2, s};
use rayon::prelude::*;

use crate::batch::Batch;
use crate::layer::{Centres, LayerMut, Module, NeighborPool};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::mlp::{DenseHead, Stack};
use crate::network::Rates;
use crate::shape::{Abstraction, Shape};

/// A network of set abstractions in training.
#[derive(Clone, Debug)]
pub struct SetNetwork {
    points: Stack,
    levels: Vec<Level>,
    head: DenseHead,
}

/// A set abstraction: a pooling over neighborhoods and the layers after it.
#[derive(Clone, Debug)]
struct Level {
    pool: NeighborPool,
    layers: Stack,
    n_centres: usize,
    centres: Centres,
}

/// The features of a level's input with their coordinates and clouds.
#[derive(Clone, Copy)]
struct Features<'a> {
    values: ArrayView2<'a, f32>,
    points: &'a [[f32; 3]],
    starts: &'a [usize],
}

impl SetNetwork {
    /// A network with random weights for `n_classes` classes.
    ///
    /// # Panics
    /// If `shape` has no abstraction, or a part without layers.
    #[must_use]
    pub fn new(shape: &Shape, n_classes: usize, seed: u64) -> Self {
        let mut width = shape.trunk[shape.trunk.len() - 1];
        let numbered = shape.abstractions.iter().zip(1..);
        let levels = numbered.map(|(abstraction, number)| {
            let level = Level::new(abstraction, number, width, seed);
            width = abstraction.widths[abstraction.widths.len() - 1];
            level
        });
        let levels = levels.collect();
        let widths = [&[2 * width], &shape.head[..], &[n_classes]].concat();
        Self {
            points: Stack::new("feat.", &[&[3], &shape.trunk[..]].concat(), 1, seed),
            levels,
            head: DenseHead::new("", &widths, 0, seed),
        }
    }

    /// As [`crate::network::PointNet::learn`].
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        self.forward(batch, rates.momentum);
        let (pooled, winners) = pool(features(&self.points, &self.levels, batch));
        let logits = self.head.forward(pooled.view(), kept, rates.momentum);
        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dpooled = self.head.backward(pooled.view(), dlogits.view());
        let last = features(&self.points, &self.levels, batch);
        let mut dy = unpool(&dpooled, &winners, last.starts);
        for i in (0..self.levels.len()).rev() {
            let (before, level) = self.levels.split_at_mut(i);
            let u = features(&self.points, before, batch);
            let level = &mut level[0];
            let x = level.pool.base.output();
            let dx = level.layers.backward(x, dy, level.centres.rows(), true);
            let dx = dx.expect("invariant: `wants_input` is true");
            dy = level.pool.backward(dx, u.values, (u.points, u.starts), &level.centres);
        }
        self.points.backward(batch.points(), dy, batch.rows(), false);
        loss
    }

    fn forward(&mut self, batch: &Batch, momentum: f32) {
        self.points.forward(batch.points(), batch.rows(), None, momentum);
        let mut picked = farthest(batch, self.levels[0].n_centres);
        for i in 0..self.levels.len() {
            let (before, level) = self.levels.split_at_mut(i);
            let u = features(&self.points, before, batch);
            let level = &mut level[0];
            // Farthest points come in an order of which every beginning is a sample: those of the
            // next level are the first of this one.
            picked.iter_mut().for_each(|picked| picked.truncate(level.n_centres));
            level.centres = Centres::new(u.points, u.starts, &picked);
            picked.iter_mut().for_each(|picked| *picked = (0..picked.len() as u32).collect());
            level.pool.forward(u.values, (u.points, u.starts), &level.centres, momentum);
            let x = level.pool.base.output();
            level.layers.forward(x, level.centres.rows(), None, momentum);
        }
    }

    /// The width of the dropout mask.
    #[must_use]
    pub fn dropout_width(&self) -> Option<usize> {
        self.head.hidden_width()
    }
}

impl Level {
    fn new(abstraction: &Abstraction, number: usize, channels: usize, seed: u64) -> Self {
        let Abstraction { centres, radius, widths } = abstraction;
        let prefix = format!("sa{number}.");
        let [linear, norm] = ["conv1", "bn1"].map(|part| format!("{prefix}{part}"));
        Self {
            pool: NeighborPool::new(&linear, &norm, *radius, channels, seed),
            layers: Stack::new(&prefix, &[&[channels], &widths[..]].concat(), 2, seed),
            n_centres: *centres,
            centres: Centres::default(),
        }
    }
}

/// The output of `levels`, or of the point-wise layers if there are none.
fn features<'a>(points: &'a Stack, levels: &'a [Level], batch: &'a Batch) -> Features<'a> {
    match levels.last() {
        Some(Level { layers, centres, .. }) => {
            Features { values: layers.output(), points: &centres.points, starts: &centres.starts }
        }
        None => {
            Features { values: points.output(), points: &batch.coordinates, starts: &batch.starts }
        }
    }
}

/// The indices of up to `n` farthest points of each cloud, as infer-cpu chooses them.
fn farthest(batch: &Batch, n: usize) -> Vec<Vec<u32>> {
    let clouds = batch.starts.par_windows(2).map(|pair| {
        let kernels = infer_cpu::kernel::fastest();
        let (cloud, mut picked) = (&batch.coordinates[pair[0]..pair[1]], Vec::with_capacity(n));
        FarthestPoints::default().select(cloud, n, FpsStart::Farthest, kernels, &mut picked);
        picked
    });
    clouds.collect()
}

/// The maxima of each cloud's features followed by their means, and the rows of the maxima.
fn pool(features: Features<'_>) -> (Matrix, Vec<usize>) {
    let (channels, n_clouds) = (features.values.ncols(), features.starts.len() - 1);
    let clouds = features.starts.par_windows(2).map(|pair| {
        let mut winners = vec![pair[0]; channels];
        let mut largest = vec![f32::NEG_INFINITY; channels];
        let mut mean = vec![0.0; channels];
        for row in pair[0]..pair[1] {
            for (c, &x) in features.values.row(row).iter().enumerate() {
                mean[c] += x;
                if x > largest[c] {
                    (largest[c], winners[c]) = (x, row);
                }
            }
        }
        mean.iter_mut().for_each(|mean| *mean /= (pair[1] - pair[0]) as f32);
        ([largest, mean].concat(), winners)
    });
    let (pooled, winners): (Vec<_>, Vec<_>) = clouds.unzip();
    let pooled = Matrix::from_shape_vec((n_clouds, 2 * channels), pooled.concat());
    (pooled.expect("invariant: two values a channel"), winners.concat())
}

/// The gradient of the features that [`pool`] took, from that of what it returned.
fn unpool(dpooled: &Matrix, winners: &[usize], starts: &[usize]) -> Matrix {
    let channels = dpooled.ncols() / 2;
    let mut dy = Matrix::zeros((starts[starts.len() - 1], channels));
    for (cloud, pair) in starts.windows(2).enumerate() {
        let n = (pair[1] - pair[0]) as f32;
        let mean = dpooled.slice(s![cloud, channels..]).mapv(|x| x / n);
        dy.slice_mut(s![pair[0]..pair[1], ..])
            .rows_mut()
            .into_iter()
            .for_each(|mut dy| dy += &mean);
        for c in 0..channels {
            dy[(winners[cloud * channels + c], c)] += dpooled[(cloud, c)];
        }
    }
    dy
}

impl Module for SetNetwork {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let Self { points, levels, head } = self;
        let levels = levels.iter_mut().flat_map(|Level { pool, layers, .. }| {
            std::iter::once(pool.base.layer()).chain(layers.layers())
        });
        points.layers().chain(levels).chain(head.layers()).collect()
    }
}
