//! The Critical Points Layer (Nezhadarya et al., "Adaptive hierarchical down-sampling for point
//! cloud classification", CVPR 2020): the points that win a channel of a max-pooling, ranked by
//! what they win.
//!
//! Rows are points in canonical order (`canonical`). Features may precede their ReLU, since maxima
//! that are not positive count as 0.

use super::SamplerSpec;
use super::hash::{Map, reset};

/// Ranks critical points, and reuses its memory for each cloud.
#[derive(Default)]
pub struct CriticalPoints {
    /// The chosen rows, each once: pass by pass, in each the best first.
    pub rows: Vec<u32>,
    /// For each row, the sum of the maxima that it won in its pass.
    pub scores: Vec<f64>,
    /// The index of each row in `ranking`.
    ranks: Map<u32>,
    /// The scores and rows of a pass.
    ranking: Vec<(f64, u32)>,
    /// The rows that the current secondary pass pools, ascending.
    left: Vec<u32>,
    /// The rows chosen so far, ascending.
    taken: Vec<u32>,
    n_passes: usize,
    /// Whether the last pass chose no row.
    is_exhausted: bool,
}

impl CriticalPoints {
    /// Begins with the pooling of all points: `winners` holds the row that attains each of
    /// `maxima`. If several rows attain it, the pooling must decide by geometry, not by the order
    /// of the input.
    ///
    /// The score of a point is the sum of the maxima that it wins, in f64, in the order of
    /// channels. The ranking descends by score; the lower row (the lesser point) wins a tie. No row
    /// wins a channel whose maximum is not positive: after a ReLU it is 0 for all points, and a
    /// point with score 0 is not critical. If no channel is positive, the first row is chosen, with
    /// score 0.
    pub fn rank(&mut self, maxima: &[f32], winners: &[u32]) {
        self.rows.clear();
        self.scores.clear();
        self.n_passes = 0;
        self.is_exhausted = false;
        self.pool(maxima, winners);
        // The network needs at least one point.
        if self.ranking.is_empty() {
            self.ranking.push((0.0, 0));
        }
        self.append(|row| row);
    }

    /// The rows that a secondary pass must pool, ascending: all of `n_rows` that are not chosen
    /// yet. `None` if `spec` requests no more points or passes, if no point is left, or if the last
    /// pass chose none.
    pub fn next_pass(&mut self, n_rows: usize, spec: &SamplerSpec) -> Option<&[u32]> {
        let has_enough = self.rows.len() >= spec.points.min(n_rows);
        if has_enough || self.n_passes == spec.passes || self.is_exhausted {
            return None;
        }
        self.n_passes += 1;
        // `rows` must stay in the order of the ranking, so a copy is sorted.
        self.taken.clear();
        self.taken.extend(&self.rows);
        self.taken.sort_unstable();
        self.left.clear();
        let mut first = 0;
        for &taken in &self.taken {
            self.left.extend(first..taken);
            first = taken + 1;
        }
        self.left.extend(first..n_rows as u32);
        Some(&self.left)
    }

    /// Appends the critical points of a secondary pass, ranked among themselves. `winners` are
    /// indices into the rows of [`Self::next_pass`].
    pub fn rank_next(&mut self, maxima: &[f32], winners: &[u32]) {
        self.pool(maxima, winners);
        self.is_exhausted = self.ranking.is_empty();
        // Moved out, because `append` borrows `self`.
        let left = std::mem::take(&mut self.left);
        self.append(|place| left[place as usize]);
        self.left = left;
    }

    /// Allocates memory for poolings of `channels` channels over `n_rows` rows.
    pub fn reserve(&mut self, channels: usize, n_rows: usize) {
        self.rows.reserve(n_rows);
        self.scores.reserve(n_rows);
        self.taken.reserve(n_rows);
        self.left.reserve(n_rows);
        self.ranking.reserve(channels);
        reset(&mut self.ranks, channels);
    }

    /// Ranks the winners of one pooling.
    fn pool(&mut self, maxima: &[f32], winners: &[u32]) {
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
        // Rows are distinct, so the order is total, and an unstable sort is deterministic.
        self.ranking.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    }

    fn append(&mut self, row: impl Fn(u32) -> u32) {
        self.rows.extend(self.ranking.iter().map(|&(_, place)| row(place)));
        self.scores.extend(self.ranking.iter().map(|&(score, _)| score));
    }
}

#[cfg(test)]
mod tests {
    use super::super::canonical::CanonicalOrder;
    use super::super::testing::{any_cloud, gather, shuffled};
    use super::*;
    use proptest::prelude::*;

    fn ranked(maxima: &[f32], winners: &[u32]) -> CriticalPoints {
        let mut critical = CriticalPoints::default();
        critical.rank(maxima, winners);
        critical
    }

    #[test]
    fn points_are_ranked_by_the_sum_of_what_they_win() {
        let critical = ranked(&[1.0, 5.0, 2.0, 1.5, 3.0], &[4, 0, 4, 7, 4]);
        assert_eq!(critical.rows, [4, 0, 7]);
        assert_eq!(critical.scores, [6.0, 5.0, 1.5]);
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
        assert_eq!((critical.rows, critical.scores), (vec![3], vec![2.0]));
    }

    #[test]
    fn without_a_positive_channel_the_first_row_is_left() {
        let critical = ranked(&[0.0, -1.0], &[4, 5]);
        assert_eq!((critical.rows, critical.scores), (vec![0], vec![0.0]));
        assert_eq!(ranked(&[], &[]).rows, [0]);
    }

    #[test]
    fn sums_beyond_f32_are_ranked() {
        let critical = ranked(&[f32::MAX, f32::MAX, f32::INFINITY, f32::MAX], &[1, 2, 0, 2]);
        assert_eq!(critical.rows, [0, 2, 1]);
    }

    /// Pools a row for each point, whose channels are its coordinates and their negatives.
    fn pool(points: &[[f32; 3]], rows: &[u32]) -> (Vec<f32>, Vec<u32>) {
        let channel = |channel: usize| {
            let sign = if channel < 3 { 1.0 } else { -1.0 };
            let features = rows.iter().map(|&row| sign * points[row as usize][channel % 3]);
            let mut best = (f32::NEG_INFINITY, 0);
            for (place, feature) in features.enumerate() {
                if feature > best.0 {
                    best = (feature, place as u32);
                }
            }
            best
        };
        (0..6).map(channel).unzip()
    }

    fn with_passes(points: &[[f32; 3]], spec: &SamplerSpec) -> CriticalPoints {
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let (maxima, winners) = pool(points, &all);
        let mut critical = ranked(&maxima, &winners);
        while let Some(left) = critical.next_pass(points.len(), spec) {
            let (maxima, winners) = pool(points, left);
            critical.rank_next(&maxima, &winners);
        }
        critical
    }

    #[test]
    fn a_secondary_pass_chooses_among_the_points_left() {
        let line: Vec<[f32; 3]> = (0..10u8).map(|i| [f32::from(i), 0.0, 0.0]).collect();
        let chosen = |points, passes| {
            with_passes(&line, &SamplerSpec { points, passes, ..SamplerSpec::default() }).rows
        };
        assert_eq!(chosen(4, 0), [9]);
        assert_eq!(chosen(4, 2), [9, 8, 7]);
        assert_eq!(chosen(2, 9), [9, 8]);
        // The point at 0 wins no positive channel.
        assert_eq!(chosen(99, 99), [9, 8, 7, 6, 5, 4, 3, 2, 1]);
    }

    proptest! {
        #[test]
        fn the_order_of_the_input_does_not_matter(
            cloud in any_cloud().prop_filter("needs a point", |cloud| !cloud.is_empty()),
            seed in any::<u32>(),
            passes in 0usize..4,
        ) {
            let spec = SamplerSpec { points: 20, passes, ..SamplerSpec::default() };
            let choose = |cloud: &[[f32; 3]]| {
                let mut order = CanonicalOrder::default();
                order.sort(cloud);
                let critical = with_passes(&order.points, &spec);
                (gather(&order.points, &critical.rows), critical.scores)
            };
            prop_assert_eq!(choose(&cloud), choose(&shuffled(&cloud, seed)));
        }

        #[test]
        fn no_row_is_chosen_twice(cloud in any_cloud(), passes in 0usize..9) {
            let spec = SamplerSpec { passes, ..SamplerSpec::default() };
            let mut rows = with_passes(&cloud, &spec).rows;
            let n = rows.len();
            rows.sort_unstable();
            rows.dedup();
            prop_assert_eq!(rows.len(), n);
        }
    }
}
