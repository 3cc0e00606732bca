//! How long things take.

use std::time::Duration;

use hdrhistogram::Histogram;

formats::named! {
    /// A stage of the pipeline.
    pub enum Stage: "stage" {
        /// Packets become points.
        Decode = "decode",
        /// Points become clusters.
        Segment = "segment",
        /// Clusters get classes.
        Classify = "classify",
        /// Clusters get boxes and tracks.
        Track = "track",
    }
}

/// The time of each stage a turn, and the latency of each answer.
pub struct Stats {
    /// What the turn at hand has taken so far, by stage.
    turn: [Duration; Stage::ALL.len()],
    stages: [Histogram<u64>; Stage::ALL.len()],
    latency: Histogram<u64>,
}

/// The longest time that is told apart, microseconds.
const MOST_US: u64 = 100_000_000;

impl Stats {
    pub(super) fn new() -> Self {
        // Bounds and digits are constants that the crate accepts.
        let histogram = || Histogram::new_with_bounds(1, MOST_US, 2).expect("invariant: bounds");
        Self {
            turn: [Duration::ZERO; Stage::ALL.len()],
            stages: Stage::ALL.map(|_| histogram()),
            latency: histogram(),
        }
    }

    pub(super) fn spend(&mut self, stage: Stage, time: Duration) {
        self.turn[stage as usize] += time;
    }

    pub(super) fn end_turn(&mut self) {
        for (stage, time) in self.stages.iter_mut().zip(&mut self.turn) {
            stage.saturating_record(time.as_micros() as u64);
            *time = Duration::ZERO;
        }
    }

    pub(super) fn answered_after(&mut self, latency: Duration) {
        self.latency.saturating_record(latency.as_micros() as u64);
    }

    /// How many turns were measured.
    #[must_use]
    pub fn n_turns(&self) -> u64 {
        self.stages[0].len()
    }

    /// The time below which `share` (0 to 1) of the turns took in a stage, milliseconds.
    #[must_use]
    pub fn stage_ms(&self, stage: Stage, share: f64) -> f64 {
        self.stages[stage as usize].value_at_quantile(share) as f64 / 1e3
    }

    /// The mean time of a stage a turn, milliseconds.
    #[must_use]
    pub fn mean_ms(&self, stage: Stage) -> f64 {
        self.stages[stage as usize].mean() / 1e3
    }

    /// The time below which `share` (0 to 1) of the answers came after their cluster's last
    /// packet, milliseconds; `None` where packets did not come at their time.
    #[must_use]
    pub fn latency_ms(&self, share: f64) -> Option<f64> {
        (!self.latency.is_empty()).then(|| self.latency.value_at_quantile(share) as f64 / 1e3)
    }
}
