//! The point encoder of a Critical Points Layer, which is trained together with the network after
//! it.
//!
//! The selection of points has no derivative, so that the gradient of the network's loss does not
//! reach the encoder. Therefore the encoder has its own classification loss: in training, a linear
//! layer classifies its pooled features. The gradient of this loss flows through the maximum to the
//! points that won channels, which are the critical points, which the code of infer-cpu ranks. A
//! trained encoder can also serve alone, as a sampler.

use crate::batch::Batch;
use crate::cpl::Cpl;
use crate::critical_points::critical_points;
use crate::layer::{LayerMut, Linear, Module};
use crate::loss;
use crate::mlp::SharedMlp;

/// The prefix of the parameters that only training needs. Model files leave them out.
pub const TRAINING_ONLY: &str = "cpl.classes";

/// A point encoder in training.
#[derive(Clone, Debug)]
pub struct PointEncoder {
    mlp: SharedMlp,
    classes: Linear,
    keep: usize,
    weight: f32,
}

impl PointEncoder {
    /// A point encoder with random weights.
    #[must_use]
    pub fn new(cpl: &Cpl, n_classes: usize, seed: u64) -> Self {
        let widths = [&[3], &cpl.front[..]].concat();
        let pooled = widths[widths.len() - 1];
        Self {
            mlp: SharedMlp::new("cpl.", &widths, 1, true, seed),
            classes: Linear::new(TRAINING_ONLY, pooled, n_classes, seed),
            keep: cpl.keep,
            weight: cpl.weight as f32,
        }
    }

    /// Selects the critical points of `batch`.
    pub fn forward(&mut self, batch: &Batch, momentum: f32) -> Batch {
        self.mlp.forward(batch.points(), batch.rows(), momentum);
        critical_points(&self.mlp.pooled, batch, self.keep)
    }

    /// Runs the backward pass of the encoder's own loss, which it returns.
    pub fn backward(&mut self, batch: &Batch) -> f64 {
        let pooled = self.mlp.pooled.base.output().to_owned();
        let logits = self.classes.forward(pooled.view());
        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dlogits = dlogits * self.weight;
        let dpooled = self.classes.backward(pooled.view(), dlogits.view());
        self.mlp.backward(batch.points(), dpooled, batch.rows(), false);
        f64::from(self.weight) * loss.total
    }
}

impl Module for PointEncoder {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        self.mlp.layers().into_iter().chain([self.classes.layer()]).collect()
    }
}
