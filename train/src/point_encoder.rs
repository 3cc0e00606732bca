//! The point encoder of a Critical Points Layer, which is trained together with the network after
//! it.
//!
//! The selection of points has no derivative, so that the gradient of the network's loss does not
//! reach the encoder, unless the selection is relaxed ([`crate::gumbel`]). Therefore the encoder
//! has its own classification loss: in training, a linear layer classifies its pooled features. The
//! gradient of this loss flows through the maximum to the points that won channels, which are the
//! critical points, which the code of infer-cpu ranks. A trained encoder can also serve alone, as a
//! sampler.

use crate::batch::Batch;
use crate::cpl::Cpl;
use crate::layer::{LayerMut, Linear, Module};
use crate::loss;
use crate::matrix::Matrix;
use crate::mlp::SharedMlp;
use crate::network::Rates;
use crate::selector::{CriticalPointSelector, Selection};

/// The prefix of the parameters that only training needs. Model files leave them out.
pub const TRAINING_ONLY: &str = "cpl.classes";

/// A point encoder in training.
#[derive(Clone, Debug)]
pub struct PointEncoder {
    mlp: SharedMlp,
    classes: Linear,
    selector: CriticalPointSelector,
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
            selector: CriticalPointSelector::new(cpl, seed),
            weight: cpl.weight as f32,
        }
    }

    /// Selects the critical points of `batch`.
    pub fn forward(&mut self, batch: &Batch, rates: Rates) -> Selection {
        self.mlp.forward(batch.points(), batch.rows(), rates.momentum);
        self.selector.select(&self.mlp.pooled, batch, rates.step)
    }

    /// Runs the backward pass of the encoder's own loss, which it returns. `dpoints` is the
    /// gradient of the selected points' coordinates, if the selection has a gradient.
    pub fn backward(
        &mut self,
        batch: &Batch,
        selection: &Selection,
        dpoints: Option<&Matrix>,
    ) -> f64 {
        let pooled = self.mlp.pooled.base.output().to_owned();
        let logits = self.classes.forward(pooled.view());
        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dlogits = dlogits * self.weight;
        let mut dpooled = self.classes.backward(pooled.view(), dlogits.view());
        if let Some(dpoints) = dpoints {
            self.selector.add_gradient(&self.mlp.pooled, selection, dpoints, &mut dpooled);
        }
        self.mlp.backward(batch.points(), dpooled, batch.rows(), false);
        f64::from(self.weight) * loss.total
    }

    /// Whether the selection has a gradient.
    #[must_use]
    pub fn is_relaxed(&self) -> bool {
        self.selector.is_relaxed()
    }
}

impl Module for PointEncoder {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        self.mlp.layers().into_iter().chain([self.classes.layer()]).collect()
    }
}
