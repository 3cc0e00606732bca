//! Selects the critical points of the clouds in a batch, which the code of infer-cpu ranks.

use infer_cpu::sampler::CriticalPoints;

use crate::batch::Batch;
use crate::layer::PooledLayer;

/// The points of `batch` that win channels of `pooled`, the pooling of all points: the `keep` of each
/// cloud that win most, or fewer.
#[must_use]
pub fn critical_points(pooled: &PooledLayer, batch: &Batch, keep: usize) -> Batch {
    let mut chosen = Batch { starts: vec![0], ..Batch::default() };
    let mut critical = CriticalPoints::default();
    for (cloud, maxima) in pooled.base.output().rows().into_iter().enumerate() {
        let maxima = maxima.to_slice().expect("invariant: rows are contiguous");
        let first = batch.starts[cloud] as u32;
        critical.rank(maxima, &within(pooled.winners(cloud), first));
        let mut rows: Vec<u32> = critical.rows.iter().copied().take(keep).collect();
        rows.sort_unstable();
        for row in rows.into_iter().map(|row| row + first) {
            chosen.coordinates.push(batch.coordinates[row as usize]);
            chosen.weights.push(1.0);
        }
        chosen.starts.push(chosen.coordinates.len());
    }
    chosen.neighborhood.clone_from(&batch.neighborhood);
    chosen.neighborhood_starts.clone_from(&batch.neighborhood_starts);
    chosen.targets.clone_from(&batch.targets);
    chosen
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
        let chosen = critical_points(&pooled, &batch, 64);
        assert_eq!(chosen.coordinates, [batch.coordinates[0], batch.coordinates[2]]);
    }
}
