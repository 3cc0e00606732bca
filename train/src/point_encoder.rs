//! The point encoder of a Critical Points Layer, trained together with the
//! network behind it.
//!
//! The selection of points has no derivative: no gradient of the network's loss
//! reaches the encoder, unless the selection is relaxed ([`crate::gumbel`]).
//! Therefore the encoder has a loss of its own: its pooled features go through
//! one linear layer to the classes. That layer is used in training only.
//! Its gradient flows back through the maximum to the points that won channels,
//! and these are the critical points. A trained encoder can be used alone, as a
//! sampler. infer-cpu's own code ranks and resizes the selection.

use crate::batch::Batch;
use crate::cpl::Cpl;
use crate::layer::{LayerMut, Linear, Module};
use crate::loss;
use crate::matrix::Matrix;
use crate::mlp::SharedMlp;
use crate::network::Rates;
use crate::selector::{CriticalPointSelector, Selection};

/// The prefix of the parameters that model files leave out.
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
    /// A point encoder of random weights.
    ///
    /// # Errors
    /// An unknown rule of resizing.
    pub fn new(cpl: &Cpl, n_classes: usize, seed: u64) -> Result<Self, String> {
        let widths = [&[3], &cpl.front[..]].concat();
        let pooled = widths[widths.len() - 1];
        Ok(Self {
            mlp: SharedMlp::new("cpl.", &widths, 1, true, seed),
            classes: Linear::new(TRAINING_ONLY, pooled, n_classes, seed),
            selector: CriticalPointSelector::new(cpl, seed)?,
            weight: cpl.weight as f32,
        })
    }

    /// Selects the critical points of `batch`.
    pub fn forward(&mut self, batch: &Batch, rates: Rates) -> Selection {
        self.mlp.forward(batch.points(), batch.rows(), rates.momentum);
        self.selector.select(&self.mlp.pooled, batch, rates.step)
    }

    /// Takes the gradients of its own loss, which it returns, and of the selected
    /// points' coordinates, where the selection has a gradient.
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
