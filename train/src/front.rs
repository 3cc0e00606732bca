//! The front end of a Critical Points Layer, trained together with the network
//! behind it.
//!
//! Which points are chosen has no derivative: no gradient of the network's loss
//! comes to the front end. So it has a loss of its own: its pooled features go
//! through one linear layer to the classes, which is left behind after training.
//! Its gradient comes back, through the maximum, to the points that won
//! channels, and those are the points that are chosen. A front end of its own
//! can be trained so and taken out as a sampler; points are ranked and resized
//! by infer-cpu's own code.

use infer_cpu::sampler::{CriticalPoints, Resize};
use serde::{Deserialize, Serialize};

use crate::batch::Batch;
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
}

impl Default for Cpl {
    /// The paper's front end (Meyer and Reitmann 2026), and its 64 points.
    fn default() -> Self {
        Self { front: vec![64, 128, 1024], keep: 64, resize: "truncate".to_owned(), weight: 1.0 }
    }
}

/// A front end in training.
#[derive(Clone, Debug)]
pub struct Front {
    points: Points,
    classes: Linear,
    keep: usize,
    resize: Resize,
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
            keep: cpl.keep,
            resize: cpl.resize.parse().map_err(|error| format!("{error}"))?,
            weight: cpl.weight as f32,
        })
    }

    /// Learns from `batch` and returns its critical points, and its own loss.
    fn learn(&mut self, batch: &Batch, rates: Rates) -> (Batch, f64) {
        let (x, rows) = (batch.points(), batch.rows());
        self.points.forward(x.view(), rows, rates.momentum);
        let pooled = self.points.pooled.output().to_owned();
        let chosen = self.choose(batch);
        let logits = self.classes.forward(pooled.view());
        let (loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dlogits = dlogits * self.weight;
        let dpooled = self.classes.backward(pooled.view(), dlogits.view());
        self.points.backward(x, dpooled, rows, false);
        (chosen, f64::from(self.weight) * loss.total)
    }

    fn choose(&self, batch: &Batch) -> Batch {
        let mut chosen = Batch { starts: vec![0], ..Batch::default() };
        let mut critical = CriticalPoints::default();
        let mut rows = Vec::new();
        for (cloud, maxima) in self.points.pooled.output().rows().into_iter().enumerate() {
            let maxima = maxima.to_slice().expect("invariant: rows are contiguous");
            critical.rank(maxima, self.points.pooled.winners(cloud));
            self.resize.apply(&critical.rows, &critical.scores, self.keep, &mut rows);
            rows.sort_unstable();
            for same in rows.chunk_by(|a, b| a == b) {
                chosen.coordinates.push(batch.coordinates[same[0] as usize]);
                chosen.weights.push(same.len() as f32);
            }
            chosen.starts.push(chosen.coordinates.len());
        }
        chosen.targets.clone_from(&batch.targets);
        chosen
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
        let (chosen, own) = front.learn(batch, rates);
        let mut loss = self.network.learn(&chosen, kept, rates);
        loss.total += own;
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
