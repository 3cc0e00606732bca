use std::time::Duration;

use hdrhistogram::Histogram;

use super::counts::Counts;

formats::named! {
    /// A stage of the pipeline.
    pub enum Stage: "stage" {
        /// Decoding packets.
        Decode = "decode",
        /// Detecting the objects of turns.
        Detect = "detect",
        /// Computing boxes and tracks.
        Track = "track",
    }
}

/// The durations of each stage per turn, and the latency of each result.
pub struct Stats {
    /// The durations of the current turn, by stage.
    turn: [Duration; Stage::ALL.len()],
    stages: [Histogram<u64>; Stage::ALL.len()],
    latency: Histogram<u64>,
    /// The counts at the end of the last whole turn.
    whole: Counts,
}

/// The longest duration in a histogram, microseconds.
const MOST_US: u64 = 100_000_000;

impl Stats {
    pub(super) fn new() -> Self {
        // The bounds and digits are valid constants.
        let histogram = || Histogram::new_with_bounds(1, MOST_US, 2).expect("invariant: bounds");
        Self {
            turn: [Duration::ZERO; Stage::ALL.len()],
            stages: Stage::ALL.map(|_| histogram()),
            latency: histogram(),
            whole: Counts::default(),
        }
    }

    pub(super) fn spend(&mut self, stage: Stage, time: Duration) {
        self.turn[stage as usize] += time;
    }

    /// Ends a turn, with the counts until then. Parts of turns do not count.
    pub(super) fn end_turn(&mut self, counts: &Counts, is_whole: bool) {
        let spent = std::mem::take(&mut self.turn);
        if is_whole {
            self.whole = *counts;
            for (stage, time) in self.stages.iter_mut().zip(spent) {
                stage.saturating_record(time.as_micros() as u64);
            }
        }
    }

    pub(super) fn answered_after(&mut self, latency: Duration) {
        self.latency.saturating_record(latency.as_micros() as u64);
    }

    /// Points and clusters of the average turn.
    #[must_use]
    pub fn per_turn(&self) -> [f64; 2] {
        [self.whole.points, self.whole.clusters].map(|n| n as f64 / self.n_turns().max(1) as f64)
    }

    /// The number of measured turns.
    #[must_use]
    pub fn n_turns(&self) -> u64 {
        self.stages[0].len()
    }

    /// The quantile `share` (0 to 1) of the durations of a stage per turn, milliseconds.
    #[must_use]
    pub fn stage_ms(&self, stage: Stage, share: f64) -> f64 {
        self.stages[stage as usize].value_at_quantile(share) as f64 / 1e3
    }

    /// The mean duration of a stage per turn, milliseconds.
    #[must_use]
    pub fn mean_ms(&self, stage: Stage) -> f64 {
        self.stages[stage as usize].mean() / 1e3
    }

    /// The quantile `share` (0 to 1) of the times from an object's last packet to its result, milliseconds; `None` if packets did not arrive in real time.
    #[must_use]
    pub fn latency_ms(&self, share: f64) -> Option<f64> {
        (!self.latency.is_empty()).then(|| self.latency.value_at_quantile(share) as f64 / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Histograms of two digits are off by up to 1 %.
    #[test]
    fn each_turn_counts_with_its_own_time() {
        let mut stats = Stats::new();
        for turn in 0..10 {
            stats.spend(Stage::Detect, Duration::from_millis(turn));
            stats.spend(Stage::Detect, Duration::from_millis(2));
            stats.answered_after(Duration::from_millis(20 - turn));
            stats.end_turn(&Counts { points: 5 * (turn + 1), ..Counts::default() }, true);
            stats.spend(Stage::Detect, Duration::from_secs(1));
            stats.end_turn(&Counts { points: 99, ..Counts::default() }, false);
        }
        let near = |found: f64, expected: f64| (found - expected).abs() <= 0.01 * expected;
        assert!(near(stats.mean_ms(Stage::Detect), 6.5) && stats.mean_ms(Stage::Track) == 0.0);
        assert!(near(stats.stage_ms(Stage::Detect, 1.0), 11.0) && stats.n_turns() == 10);
        assert_eq!(stats.per_turn(), [5.0, 0.0]);
        assert!(near(stats.latency_ms(1.0).unwrap(), 20.0));
    }

    /// On a slow machine, or if packets wait.
    #[test]
    fn durations_of_many_seconds_count() {
        let mut stats = Stats::new();
        stats.spend(Stage::Detect, Duration::from_secs(3));
        stats.end_turn(&Counts::default(), true);
        stats.answered_after(Duration::from_secs(30));
        let near = |found: f64, expected: f64| (found - expected).abs() <= 0.01 * expected;
        assert!(near(stats.mean_ms(Stage::Detect), 3e3), "{}", stats.mean_ms(Stage::Detect));
        assert!(near(stats.latency_ms(0.5).unwrap(), 30e3), "{:?}", stats.latency_ms(0.5));
    }
}
