//! EdgeConv: a linear layer on the offsets from each point to its neighbors, a batch norm, a ReLU
//! and the maximum over the neighbors, as infer-cpu's `edge_conv.rs` defines it. It is a pooled
//! layer whose clouds are the neighborhoods.

use infer_cpu::kernel::Neighborhood;
use ndarray::parallel::prelude::*;

use super::PooledLayer;
use crate::batch::{Batch, Rows};
use crate::matrix::Matrix;

/// An EdgeConv layer with one radius.
#[derive(Clone, Debug)]
pub struct EdgeLayer {
    /// The parameters, and the last output, `[points, channels]`.
    pub pooled: PooledLayer,
    radius: f32,
    edges: Edges,
}

/// The edges from each point of a batch to its neighbors.
#[derive(Clone, Debug, Default)]
struct Edges {
    /// The offsets divided by the radius, `[edges, 3]`.
    offsets: Matrix,
    /// The weight of each edge in statistics, which is that of its point.
    weights: Vec<f32>,
    /// The first edge of each point, and the end of the last point.
    starts: Vec<usize>,
}

impl EdgeLayer {
    /// EdgeConv layer `number`, for neighbors within `radius`.
    pub fn new(number: usize, radius: f32, channels: usize, seed: u64) -> Self {
        let (linear, norm) = (format!("edge.conv{number}"), format!("edge.bn{number}"));
        let pooled = PooledLayer::new(&linear, &norm, (3, channels), true, seed);
        Self { pooled, radius, edges: Edges::default() }
    }

    /// The number of features for each point.
    pub fn channels(&self) -> usize {
        self.pooled.base.linear.size().1
    }

    /// Computes the features of every point of `batch`.
    pub fn forward(&mut self, batch: &Batch, momentum: f32) {
        self.edges = Edges::new(batch, self.radius);
        self.pooled.forward(self.edges.offsets.view(), self.edges.rows(), momentum);
    }

    /// Sets the gradients of the parameters from the gradient `dy` of the output.
    pub fn backward(&mut self, dy: Matrix) {
        self.pooled.backward(dy, self.edges.offsets.view(), self.edges.rows(), false);
    }
}

impl Edges {
    fn new(batch: &Batch, radius: f32) -> Self {
        let clouds: Vec<usize> = (0..batch.len()).collect();
        let offsets_of = |&cloud: &usize| {
            let centres = &batch.coordinates[batch.starts[cloud]..batch.starts[cloud + 1]];
            let others = Neighborhood::of(&batch.neighborhoods[cloud]);
            centres.iter().map(|&p| neighbors(p, &others, radius)).collect::<Vec<_>>()
        };
        let offsets: Vec<Vec<[f32; 3]>> = clouds.par_iter().map(offsets_of).flatten().collect();
        let mut edges = Self { starts: vec![0], ..Self::default() };
        for (neighbors, &weight) in offsets.iter().zip(&batch.weights) {
            let end = edges.weights.len() + neighbors.len();
            edges.weights.resize(end, weight);
            edges.starts.push(end);
        }
        let flat: Vec<f32> = offsets.into_iter().flatten().flatten().collect();
        edges.offsets = Matrix::from_shape_vec((flat.len() / 3, 3), flat)
            .expect("invariant: three coordinates an offset");
        edges
    }

    fn rows(&self) -> Rows<'_> {
        Rows::new(&self.weights, &self.starts)
    }
}

/// The offsets from `p` to its neighbors within `radius`, divided by `radius`. The first neighbor
/// is `p` itself; its copies in `others` are left out.
fn neighbors(p: [f32; 3], others: &Neighborhood, radius: f32) -> Vec<[f32; 3]> {
    let near = others.within(p, radius).map(|(_, q)| [0, 1, 2].map(|k| (q[k] - p[k]) / radius));
    std::iter::once([0.0; 3]).chain(near.filter(|offset| *offset != [0.0; 3])).collect()
}
