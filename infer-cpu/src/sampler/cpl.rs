//! The Critical Points Layer (Nezhadarya et al., "Adaptive hierarchical down-sampling for point
//! cloud classification", CVPR 2020): the points that win a channel of a max-pooling, ranked by
//! what they win.
//!
//! Rows are points in canonical order (`canonical`). Features may precede their ReLU, since maxima
//! that are not positive count as 0.

use super::hash::{Map, reset};

/// Ranks critical points, and reuses its memory for each cloud.
#[derive(Default)]
pub struct CriticalPoints {
    /// The critical rows, each once, the best first.
    pub rows: Vec<u32>,
    /// The index of each row in `ranking`.
    ranks: Map<u32>,
    /// The rows, each after its score: the sum of the maxima that it won.
    ranking: Vec<(f64, u32)>,
}

impl CriticalPoints {
    /// Ranks the points of a pooling: `winners` holds the row that attains each of `maxima`. If
    /// several rows attain it, the pooling must decide by geometry, not by the order of the input.
    ///
    /// The score of a point is the sum of the maxima that it wins, in f64, in the order of
    /// channels. The ranking descends by score; the lower row (the lesser point) wins a tie. No row
    /// wins a channel whose maximum is not positive: after a ReLU it is 0 for all points, and a
    /// point with score 0 is not critical. If no channel is positive, the first row is chosen, with
    /// score 0.
    pub fn rank(&mut self, maxima: &[f32], winners: &[u32]) {
        reset(&mut self.ranks, maxima.len());
        self.ranking.clear();
        for (&maximum, &winner) in maxima.iter().zip(winners) {
            // This is false for NaN, too.
            if maximum > 0.0 {
                let next = self.ranking.len() as u32;
                let rank = *self.ranks.entry(winner).or_insert(next) as usize;
                if rank == self.ranking.len() {
                    self.ranking.push((0.0, winner));
                }
                self.ranking[rank].0 += f64::from(maximum);
            }
        }
        // The network needs at least one point.
        if self.ranking.is_empty() {
            self.ranking.push((0.0, 0));
        }
        // Rows are distinct, so the order is total, and an unstable sort is deterministic.
        self.ranking.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        self.rows.clear();
        self.rows.extend(self.ranking.iter().map(|&(_, row)| row));
    }

    /// Allocates memory for poolings of `channels` channels over `n_rows` rows.
    pub fn reserve(&mut self, channels: usize, n_rows: usize) {
        self.rows.reserve(n_rows);
        self.ranking.reserve(channels);
        reset(&mut self.ranks, channels);
    }
}

#[cfg(test)]
mod tests {
    use super::super::canonical::CanonicalOrder;
    use super::super::testing::{any_cloud, gather, shuffled};
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn ranked(maxima: &[f32], winners: &[u32]) -> CriticalPoints {
        let mut critical = CriticalPoints::default();
        critical.rank(maxima, winners);
        critical
    }

    #[test]
    fn points_are_ranked_by_the_sum_of_what_they_win() {
        let critical = ranked(&[1.0, 5.0, 2.0, 1.5, 3.0], &[4, 0, 4, 7, 4]);
        assert_eq!(critical.rows, [4, 0, 7]);
        assert_eq!(critical.ranking, [(6.0, 4), (5.0, 0), (1.5, 7)]);
    }

    #[test]
    fn the_lower_row_wins_a_tie() {
        assert_eq!(ranked(&[1.0, 2.0, 1.0, 2.0], &[9, 3, 9, 1]).rows, [1, 3, 9]);
    }

    #[test]
    fn a_channel_that_is_not_positive_is_won_by_nobody() {
        let nobody = u32::MAX;
        let maxima = [0.0, -1.0, 2.0, f32::NEG_INFINITY, f32::NAN];
        let critical = ranked(&maxima, &[0, 5, 3, nobody, nobody]);
        assert_eq!(critical.ranking, [(2.0, 3)]);
    }

    #[test]
    fn without_a_positive_channel_the_first_row_is_left() {
        let critical = ranked(&[0.0, -1.0], &[4, 5]);
        assert_eq!(critical.ranking, [(0.0, 0)]);
        assert_eq!(ranked(&[], &[]).rows, [0]);
    }

    #[test]
    fn sums_beyond_f32_are_ranked() {
        let critical = ranked(&[f32::MAX, f32::MAX, f32::INFINITY, f32::MAX], &[1, 2, 0, 2]);
        assert_eq!(critical.rows, [0, 2, 1]);
    }

    /// Pools a row for each point, whose channels are its coordinates and their negatives.
    fn pooled(points: &[[f32; 3]]) -> CriticalPoints {
        let channel = |channel: usize| {
            let sign = if channel < 3 { 1.0 } else { -1.0 };
            let mut best = (f32::NEG_INFINITY, 0);
            for (row, point) in (0..).zip(points) {
                let feature = sign * point[channel % 3];
                if feature > best.0 {
                    best = (feature, row);
                }
            }
            best
        };
        let (maxima, winners): (Vec<f32>, Vec<u32>) = (0..6).map(channel).unzip();
        ranked(&maxima, &winners)
    }

    proptest! {
        #[test]
        fn each_point_is_ranked_once_whatever_the_order_of_the_input(
            cloud in any_cloud().prop_filter("needs a point", |cloud| !cloud.is_empty()),
            seed in any::<u32>(),
        ) {
            let choose = |cloud: &[[f32; 3]]| {
                let mut order = CanonicalOrder::default();
                order.sort(cloud);
                let CriticalPoints { rows, ranking, .. } = pooled(&order.points);
                let scores: Vec<f64> = ranking.iter().map(|ranked| ranked.0).collect();
                prop_assert_eq!(rows.iter().collect::<BTreeSet<_>>().len(), rows.len());
                Ok((gather(&order.points, &rows), scores))
            };
            prop_assert_eq!(choose(&cloud)?, choose(&shuffled(&cloud, seed))?);
        }
    }
}
