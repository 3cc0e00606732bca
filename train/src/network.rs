//! PointNet for classification, without T-Nets, forward and backward.
//!
//! The names of parameters are those of yanx27's `pointnet_cls`, which infer-cpu reads, such as
//! `feat.conv1.weight`, `feat.bn1.bias` and `fc3.weight`.

use ndarray::{Axis, s};

use crate::batch::Batch;
use crate::layer::{EdgeLayer, LayerMut, Module};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::mlp::{DenseHead, SharedMlp};
use crate::recipe::Shape;

/// A PointNet in training.
#[derive(Clone, Debug)]
pub struct PointNet {
    edges: Vec<EdgeLayer>,
    trunk: SharedMlp,
    head: DenseHead,
}

impl PointNet {
    /// A network with random weights for `n_classes` classes.
    ///
    /// # Panics
    /// If `shape` has fewer than two layers before the pooling.
    pub fn new(shape: &Shape, n_classes: usize, seed: u64) -> Self {
        let trunk = &shape.trunk;
        let numbered = shape.edges.iter().zip(1..);
        let edges: Vec<EdgeLayer> = numbered
            .map(|(edge, number)| EdgeLayer::new(number, edge.radius, edge.channels, seed))
            .collect();
        let inputs = 3 + edges.iter().map(EdgeLayer::channels).sum::<usize>();
        let head = [&[trunk[trunk.len() - 1]], &shape.head[..], &[n_classes]].concat();
        let trunk = SharedMlp::new("feat.", &[&[inputs], &trunk[..]].concat(), false, seed);
        Self { edges, trunk, head: DenseHead::new(&head, seed) }
    }

    /// Runs the forward and backward pass of a batch, which sets the gradients of the parameters.
    /// `kept` is the dropout mask, `[clouds, last hidden width]`; `momentum` is the share of the
    /// batch in the running statistics.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, momentum: f32) -> Loss {
        let rows = batch.rows();
        let with_edges = self.edge_features(batch, momentum);
        let entry = with_edges.as_ref().map_or(batch.points(), |with_edges| with_edges.view());
        self.trunk.forward(entry, rows, momentum);
        let pooled = self.trunk.pooled.base.output().to_owned();
        let logits = self.head.forward(pooled.view(), kept, momentum);

        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dpooled = self.head.backward(pooled.view(), dlogits.view());
        let Some(dentry) = self.trunk.backward(entry, dpooled, rows, !self.edges.is_empty()) else {
            return loss;
        };
        let mut first = 3;
        for edge in &mut self.edges {
            let own = first..first + edge.channels();
            first = own.end;
            edge.backward(dentry.slice(s![.., own]).to_owned());
        }
        loss
    }

    /// The coordinates `[rows, 3]` followed by the EdgeConv features of each point. `None` if the
    /// network has no EdgeConv layer.
    fn edge_features(&mut self, batch: &Batch, momentum: f32) -> Option<Matrix> {
        if self.edges.is_empty() {
            return None;
        }
        self.edges.iter_mut().for_each(|edge| edge.forward(batch, momentum));
        let parts = self.edges.iter().map(|edge| edge.pooled.base.output());
        let parts: Vec<_> = std::iter::once(batch.points()).chain(parts).collect();
        Some(ndarray::concatenate(Axis(1), &parts).expect("invariant: a row for each point"))
    }
}

impl Module for PointNet {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let Self { edges, trunk, head } = self;
        let edges = edges.iter_mut().map(|edge| edge.pooled.base.layer());
        edges.chain(trunk.layers()).chain(head.layers()).collect()
    }
}
