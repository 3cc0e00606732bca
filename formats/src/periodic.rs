//! Numbers that begin again after a period, such as stamps and angles.

/// The shorter way around the `period` that `step` is: from minus to plus half of it.
#[must_use]
pub fn shorter_way(step: f64, period: f64) -> f64 {
    (step + period / 2.0).rem_euclid(period) - period / 2.0
}
