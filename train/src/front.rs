//! The front end of a Critical Points Layer, trained together with the network
//! behind it.
//!
//! Which points are chosen has no derivative: no gradient of the network's loss
//! comes to the front end, unless the choice is relaxed ([`crate::gumbel`]). So
//! it has a loss of its own: its pooled features go through one linear layer to
//! the classes, which is left behind after training.
//! Its gradient comes back, through the maximum, to the points that won
//! channels, and those are the points that are chosen. A front end of its own
//! can be trained so and taken out as a sampler; points are ranked and resized
//! by infer-cpu's own code.

use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::chooser::{Chooser, Chosen};
use crate::layer::{Folded, Learns, Linear};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::network::{PointNet, Rates};
use crate::parameter::Parameter;
use crate::stack::Points;

/// The parameters that are left behind.
pub const LEFT_BEHIND: &str = "cpl.classes";

/// A front end and what it hands on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cpl {
    /// Outputs of its point-wise layers, the last pooled; the paper's.
    pub front: Vec<usize>,
    /// Points that it hands on.
    pub keep: usize,
    /// How it comes to as many: truncate, cyclic, nearest or weighted.
    pub resize: String,
    /// The weight of its own loss.
    pub weight: f64,
    /// The network's T-Net of coordinates is the front end, in place of one of
    /// its own: its pooling of all points chooses those that the rest sees, and
    /// predicts their transform. `front` and `weight` have no say then.
    pub shared: bool,
    /// Chooses by chance, in proportion to scores, and lets the network's loss
    /// teach the front end by a straight-through estimator.
    pub gumbel: bool,
}

impl Default for Cpl {
    /// The paper's front end (Meyer and Reitmann 2026), and its 64 points.
    fn default() -> Self {
        let resize = "truncate".to_owned();
        let front = vec![64, 128, 1024];
        Self { front, keep: 64, resize, weight: 1.0, shared: false, gumbel: false }
    }
}

/// A front end in training.
#[derive(Clone, Debug)]
pub struct Front {
    points: Points,
    classes: Linear,
    chooser: Chooser,
    weight: f32,
}

impl Front {
    /// A front end of random weights.
    ///
    /// # Errors
    /// A rule of resizing that there is none of.
    pub fn new(cpl: &Cpl, n_classes: usize, seed: u64) -> Result<Self, String> {
        let widths = [&[3], &cpl.front[..]].concat();
        let pooled = widths[widths.len() - 1];
        Ok(Self {
            points: Points::new("cpl.", &widths, 1, true, seed),
            classes: Linear::new(LEFT_BEHIND, pooled, n_classes, seed),
            chooser: Chooser::new(cpl, seed)?,
            weight: cpl.weight as f32,
        })
    }

    /// The critical points of `batch`.
    fn forward(&mut self, batch: &Batch, rates: Rates) -> Chosen {
        self.points.forward(batch.points(), batch.rows(), rates.momentum);
        self.chooser.choose(&self.points.pooled, batch, rates.step)
    }

    /// Learns from its own loss, which is returned, and from the gradient of
    /// the chosen points, where the choice has one.
    fn backward(&mut self, batch: &Batch, chosen: &Chosen, dpoints: Option<&Matrix>) -> f64 {
        let pooled = self.points.pooled.base.output().to_owned();
        let logits = self.classes.forward(pooled.view());
        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dlogits = dlogits * self.weight;
        let mut dpooled = self.classes.backward(pooled.view(), dlogits.view());
        if let Some(dpoints) = dpoints {
            self.chooser.add_gradient(&self.points.pooled, chosen, dpoints, &mut dpooled);
        }
        self.points.backward(batch.points(), dpooled, batch.rows(), false);
        f64::from(self.weight) * loss.total
    }
}

/// A network, perhaps behind a front end.
#[derive(Clone, Debug)]
pub struct Model {
    /// What chooses points.
    pub front: Option<Front>,
    /// What classifies them.
    pub network: PointNet,
}

impl Model {
    /// Takes a batch forward and backward: gradients are left in the
    /// parameters.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        let Some(front) = &mut self.front else {
            return self.network.learn(batch, kept, rates);
        };
        let chosen = front.forward(batch, rates);
        let wanted = front.chooser.is_relaxed();
        let (mut loss, dpoints) = self.network.learn_points(&chosen.batch, kept, rates, wanted);
        loss.total += front.backward(batch, &chosen, dpoints.as_ref());
        loss
    }

    /// The first layer whose last output was not finite.
    #[must_use]
    pub fn not_finite(&self) -> &str {
        let front = self.front.as_ref().and_then(|front| front.points.not_finite());
        front.unwrap_or_else(|| self.network.not_finite())
    }
}

impl Learns for Model {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        if let Some(front) = &mut self.front {
            front.points.parameters(visit);
            front.classes.parameters(visit);
        }
        self.network.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        if let Some(front) = &mut self.front {
            front.points.statistics(visit);
        }
        self.network.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        if let Some(front) = &self.front {
            front.points.folded(visit);
        }
        self.network.folded(visit);
    }
}
