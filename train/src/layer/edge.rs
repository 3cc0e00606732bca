//! What surrounds each point: a linear layer of the offsets to its neighbours,
//! batch norm, ReLU and the maximum over them. infer-cpu's `edge.rs` has the
//! definition. It is a pooled layer whose clouds are neighbourhoods.

use ndarray::ArrayView2;
use ndarray::parallel::prelude::*;

use super::{Folded, Learns, PooledLayer, Rows};
use crate::batch::Batch;
use crate::matrix::Matrix;
use crate::parameter::Parameter;

/// The layer of one radius.
#[derive(Clone, Debug)]
pub struct EdgeLayer {
    /// What it learns, and its last output, `[points, channels]`.
    pub pooled: PooledLayer,
    radius: f32,
    edges: Edges,
}

/// From each point of a batch to its neighbours.
#[derive(Clone, Debug, Default)]
struct Edges {
    /// Offsets over the radius, `[edges, 3]`.
    offsets: Matrix,
    /// How often each counts in statistics: as its point does.
    weights: Vec<f32>,
    /// Where each point's edges begin, and where the last one's end.
    starts: Vec<usize>,
}

impl EdgeLayer {
    /// Layer `number` of those that look around, as far as `radius`.
    #[must_use]
    pub fn new(number: usize, radius: f32, channels: usize, seed: u64) -> Self {
        let (linear, norm) = (format!("edge.conv{number}"), format!("edge.bn{number}"));
        let pooled = PooledLayer::new(&linear, &norm, (3, channels), true, seed);
        Self { pooled, radius, edges: Edges::default() }
    }

    /// How many features it gives a point.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.pooled.base.linear.size().1
    }

    /// Looks around every point of `batch`.
    pub fn forward(&mut self, batch: &Batch, momentum: f32) {
        self.edges = Edges::of(batch, self.radius);
        self.pooled.forward(self.edges.offsets.view(), self.edges.rows(), momentum);
    }

    /// What the last forward pass gave.
    #[must_use]
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.pooled.base.output()
    }

    /// Sets gradients from that of the output.
    pub fn backward(&mut self, dy: Matrix) {
        self.pooled.backward(dy, self.edges.offsets.view(), self.edges.rows(), false);
    }
}

impl Edges {
    fn of(batch: &Batch, radius: f32) -> Self {
        let clouds: Vec<usize> = (0..batch.len()).collect();
        let around = |&cloud: &usize| {
            let centres = &batch.coordinates[batch.starts[cloud]..batch.starts[cloud + 1]];
            let others = batch.surroundings(cloud);
            centres.iter().map(|p| neighbours(p, others, radius)).collect::<Vec<_>>()
        };
        let around: Vec<Vec<[f32; 3]>> = clouds.par_iter().map(around).flatten().collect();
        let mut edges = Self { starts: vec![0], ..Self::default() };
        for (neighbours, &weight) in around.iter().zip(&batch.weights) {
            let end = edges.weights.len() + neighbours.len();
            edges.weights.resize(end, weight);
            edges.starts.push(end);
        }
        let flat: Vec<f32> = around.into_iter().flatten().flatten().collect();
        edges.offsets = Matrix::from_shape_vec((flat.len() / 3, 3), flat)
            .expect("invariant: three coordinates an offset");
        edges
    }

    fn rows(&self) -> Rows<'_> {
        let total = self.weights.iter().map(|&w| f64::from(w)).sum::<f64>() as f32;
        Rows { weights: &self.weights, starts: &self.starts, total }
    }
}

/// Offsets over `radius` from `p` to the points within it: p itself first, and
/// once, however often it is among `others`.
fn neighbours(p: &[f32; 3], others: &[[f32; 3]], radius: f32) -> Vec<[f32; 3]> {
    let mut offsets = vec![[0.0; 3]];
    for q in others {
        let offset = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
        let squared = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
        if squared <= radius * radius && squared > 0.0 {
            offsets.push(offset.map(|x| x / radius));
        }
    }
    offsets
}

impl Learns for EdgeLayer {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.pooled.base.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.pooled.base.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.pooled.base.folded(visit);
    }
}
