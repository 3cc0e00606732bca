//! The point encoder of a Critical Points Layer, which is trained together with the network after
//! it.
//!
//! The selection of points has no derivative, so that the gradient of the network's loss does not
//! reach the encoder. Therefore the encoder has its own classification loss: in training, a linear
//! layer classifies its pooled features. The gradient of this loss flows through the maximum to the
//! points that won channels, which are the critical points, which the code of infer-cpu ranks. A
//! trained encoder can also serve alone, as a sampler.

use infer_cpu::sampler::CriticalPoints;

use crate::batch::Batch;
use crate::layer::{LayerMut, Linear, Module, PooledLayer};
use crate::loss;
use crate::mlp::SharedMlp;
use crate::recipe::Cpl;

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
    pub fn new(cpl: &Cpl, n_classes: usize, seed: u64) -> Self {
        let widths = [&[3], &cpl.front[..]].concat();
        let pooled = widths[widths.len() - 1];
        Self {
            mlp: SharedMlp::new("cpl.", &widths, true, seed),
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
        let classes = LayerMut { linear: &mut self.classes, norm: None, output: None };
        self.mlp.layers().into_iter().chain([classes]).collect()
    }
}

/// The points of `batch` that win channels of `pooled`, the pooling of all points: the `keep` of each
/// cloud that win most, or fewer.
fn critical_points(pooled: &PooledLayer, batch: &Batch, keep: usize) -> Batch {
    let mut chosen =
        Batch { coordinates: Vec::new(), weights: Vec::new(), starts: vec![0], ..batch.clone() };
    let mut critical = CriticalPoints::default();
    for (cloud, maxima) in pooled.base.output().rows().into_iter().enumerate() {
        let maxima = maxima.to_slice().expect("invariant: rows are contiguous");
        let first = batch.starts[cloud] as u32;
        // Numbered within the cloud, because a ranking without critical points falls back to row 0.
        let winners: Vec<u32> = pooled.winners(cloud).iter().map(|row| row - first).collect();
        critical.rank(maxima, &winners);
        let mut rows: Vec<u32> = critical.rows.iter().copied().take(keep).collect();
        rows.sort_unstable();
        let points = rows.into_iter().map(|row| batch.coordinates[(row + first) as usize]);
        chosen.coordinates.extend(points);
        chosen.starts.push(chosen.coordinates.len());
    }
    chosen.weights = vec![1.0; chosen.coordinates.len()];
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_without_critical_points_keeps_one_of_its_own() {
        // With a shift far below 0, the output of the ReLU is 0.
        let mut pooled = PooledLayer::new("a", "b", (3, 4), true, 1);
        pooled.base.norm.shift.value.fill(-100.0);
        let coordinates = vec![[0.1, 0.2, 0.3], [0.5, 0.1, 0.0], [0.9, 0.8, 0.7], [0.2, 0.9, 0.4]];
        let batch =
            Batch { coordinates, weights: vec![1.0; 4], starts: vec![0, 2, 4], ..Batch::default() };
        pooled.forward(batch.points(), batch.rows(), 0.1);
        let chosen = critical_points(&pooled, &batch, 64);
        assert_eq!(chosen.coordinates, [batch.coordinates[0], batch.coordinates[2]]);
    }
}
