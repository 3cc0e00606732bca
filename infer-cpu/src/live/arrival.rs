use std::ops::RangeInclusive;
use std::time::{Instant, SystemTime};

/// Valid times of arrival, seconds of Unix time: three thousand years.
const LIKELY_S: RangeInclusive<f64> = 0.0..=1e11;

/// The time of arrival of a packet.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Unix time in seconds.
    pub time_s: f64,
    /// The moment, for latencies; `None` for packets of a capture that is read as fast as possible.
    pub moment: Option<Instant>,
}

impl Arrival {
    /// The arrival of a packet now.
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        // A clock before 1970 is not set; its time is taken as 0.
        let time_s = since.map_or(0.0, |since| since.as_secs_f64());
        Self { time_s, moment: Some(Instant::now()) }
    }

    /// The arrival at a valid time: a capture may have any time stamp.
    pub(super) fn likely(self) -> Self {
        let time_s = if LIKELY_S.contains(&self.time_s) { self.time_s } else { 0.0 };
        Self { time_s, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::Arrival;

    /// Times before 1970 and beyond the year 5000 are those of damaged captures.
    #[test]
    fn impossible_times_become_0() {
        for (time_s, expected) in
            [(1.7e9, 1.7e9), (0.0, 0.0), (-1.0, 0.0), (1.1e11, 0.0), (f64::NAN, 0.0)]
        {
            assert_eq!(Arrival { time_s, moment: None }.likely().time_s, expected);
        }
    }
}
