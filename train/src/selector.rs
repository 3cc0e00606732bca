//! Selects the critical points of the clouds in a batch, which the code of infer-cpu ranks.

use formats::streams::Stream;
use infer_cpu::sampler::CriticalPoints;

use crate::batch::Batch;
use crate::cpl::Cpl;
use crate::gumbel;
use crate::layer::PooledLayer;
use crate::matrix::Matrix;

/// Selects the points that win channels of a pooling.
#[derive(Clone, Copy, Debug)]
pub struct CriticalPointSelector {
    keep: usize,
    gumbel: bool,
    seed: u64,
}

/// Points that were selected from a batch.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The selected points.
    pub batch: Batch,
    /// The row of each selected point in the whole batch.
    pub rows: Vec<u32>,
}

impl CriticalPointSelector {
    /// A selector with the settings of `cpl`.
    #[must_use]
    pub fn new(cpl: &Cpl, seed: u64) -> Self {
        Self { keep: cpl.keep, gumbel: cpl.gumbel, seed }
    }

    /// Whether the selection has a gradient.
    #[must_use]
    pub fn is_relaxed(self) -> bool {
        self.gumbel
    }

    /// Selects the points of `batch` that win channels of `pooled`, the pooling of all points. A
    /// relaxed selection draws new noise in each `step`.
    #[must_use]
    pub fn select(self, pooled: &PooledLayer, batch: &Batch, step: u64) -> Selection {
        let mut chosen = Batch { starts: vec![0], ..Batch::default() };
        let mut origin = Vec::new();
        let mut critical = CriticalPoints::default();
        for (cloud, maxima) in pooled.base.output().rows().into_iter().enumerate() {
            let maxima = maxima.to_slice().expect("invariant: rows are contiguous");
            let first = batch.starts[cloud] as u32;
            critical.rank(maxima, &within(pooled.winners(cloud), first));
            let mut rows = if self.gumbel {
                let stream = Stream::Gumbel { step, cloud: cloud as u32 }.key(self.seed);
                gumbel::top(&critical.rows, &critical.scores, self.keep, stream)
            } else {
                critical.rows.iter().copied().take(self.keep).collect()
            };
            rows.sort_unstable();
            for row in rows.into_iter().map(|row| row + first) {
                chosen.coordinates.push(batch.coordinates[row as usize]);
                chosen.weights.push(1.0);
                origin.push(row);
            }
            chosen.starts.push(chosen.coordinates.len());
        }
        chosen.neighborhood.clone_from(&batch.neighborhood);
        chosen.neighborhood_starts.clone_from(&batch.neighborhood_starts);
        chosen.targets.clone_from(&batch.targets);
        Selection { batch: chosen, rows: origin }
    }

    /// Adds the gradient through the relaxed selection to `dpooled`, the gradient of the output of
    /// `pooled`. `dpoints` is the gradient of the selected points' coordinates.
    pub fn add_gradient(
        self,
        pooled: &PooledLayer,
        selection: &Selection,
        dpoints: &Matrix,
        dpooled: &mut Matrix,
    ) {
        let mut critical = CriticalPoints::default();
        for (cloud, maxima) in pooled.base.output().rows().into_iter().enumerate() {
            let maxima = maxima.to_slice().expect("invariant: rows are contiguous");
            let winners = pooled.winners(cloud);
            critical.rank(maxima, winners);
            let mut weights = vec![0.0; critical.rows.len()];
            let place = |row| critical.rows.iter().position(|&critical| critical == row);
            for i in selection.batch.starts[cloud]..selection.batch.starts[cloud + 1] {
                let point = selection.batch.coordinates[i];
                let terms = point.iter().zip(dpoints.row(i)).map(|(x, d)| f64::from(x * d));
                if let Some(place) = place(selection.rows[i]) {
                    weights[place] = terms.sum();
                }
            }
            let scores = gumbel::score_gradients(&critical.scores, &weights, self.keep);
            for (channel, &winner) in winners.iter().enumerate().filter(|(c, _)| maxima[*c] > 0.0) {
                if let Some(place) = place(winner) {
                    dpooled[(cloud, channel)] += scores[place] as f32;
                }
            }
        }
    }
}

/// Numbers the rows within the cloud that begins at row `first`, because a ranking without critical
/// points falls back to row 0.
fn within(winners: &[u32], first: u32) -> Vec<u32> {
    winners.iter().map(|winner| winner - first).collect()
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
        let chosen = CriticalPointSelector::new(&Cpl::default(), 0).select(&pooled, &batch, 0);
        assert_eq!(chosen.rows, [0, 2]);
        assert_eq!(chosen.batch.coordinates[1], batch.coordinates[2]);
    }

    #[test]
    fn a_relaxed_selection_differs_from_step_to_step_and_from_cloud_to_cloud() {
        let mut pooled = PooledLayer::new("a", "b", (3, 64), true, 1);
        let cloud: Vec<[f32; 3]> =
            (0..40u8).map(|i| [1.7, 2.9, 4.3].map(|f| (f * f32::from(i)).sin())).collect();
        let coordinates = [cloud.clone(), cloud].concat();
        let starts = vec![0, 40, 80];
        let batch = Batch { coordinates, weights: vec![1.0; 80], starts, ..Batch::default() };
        pooled.forward(batch.points(), batch.rows(), 0.1);
        let cpl = Cpl { gumbel: true, keep: 8, ..Cpl::default() };
        let chosen = |step| {
            let rows = CriticalPointSelector::new(&cpl, 0).select(&pooled, &batch, step).rows;
            rows.into_iter().partition::<Vec<u32>, _>(|row| *row < 40)
        };
        let (first, second) = chosen(0);
        assert_ne!(first, second.iter().map(|row| row - 40).collect::<Vec<_>>());
        assert_eq!((first.clone(), second.clone()), chosen(0));
        assert_ne!(first, chosen(1).0);
    }
}
