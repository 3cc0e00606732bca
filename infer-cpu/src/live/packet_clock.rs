//! The times of packets: their order, losses, and Unix times.

/// A gap of this length, or a step back by it, counts as a restart of the sensor.
const RESTART_S: f64 = 1.0;
/// The share of the difference between the clocks of host and sensor by which each packet corrects
/// the time. The clocks drift apart by some microseconds per second, and packets arrive with a
/// jitter of milliseconds.
const DRIFT_SHARE: f64 = 1e-3;

/// Follows the time stamps of one sensor.
#[derive(Clone, Debug)]
pub struct PacketClock {
    /// The period of the time stamps in microseconds, if they wrap around.
    wraps_us: Option<f64>,
    /// The Unix time of the arrival of the first packet, seconds. Steps are added up separately
    /// from Unix time, which an f64 holds to a quarter of a microsecond: rounding would add up to
    /// 100 µs in a thousand steps.
    start_s: f64,
    last: Option<Last>,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    stamp_us: f64,
    duration_us: f64,
    /// When it was sent, in seconds since the start.
    after_s: f64,
}

/// The relation of a packet to the one before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Succession {
    First,
    /// It follows, after a number of missing packets.
    Follows {
        missing: u64,
    },
    Duplicate,
    /// It was sent before the last packet.
    Late,
    /// The sensor or its clock has restarted.
    Restart,
}

impl PacketClock {
    /// A clock for time stamps with a period of `wraps_us` microseconds, if they wrap around.
    pub fn new(wraps_us: Option<f64>) -> Self {
        Self { wraps_us, start_s: 0.0, last: None }
    }

    /// Registers a packet with this time stamp and duration, which arrived at the Unix time
    /// `arrival_s`. Returns its relation to the one before, and when it was sent: the sensor's
    /// clock in Unix time.
    pub fn take(&mut self, stamp_us: f64, duration_us: f64, arrival_s: f64) -> (Succession, f64) {
        let Some(last) = self.last else {
            self.start_s = arrival_s;
            self.last = Some(Last { stamp_us, duration_us, after_s: 0.0 });
            return (Succession::First, arrival_s);
        };
        let arrived_s = arrival_s - self.start_s;
        let mut step_us = stamp_us - last.stamp_us;
        if let Some(wraps_us) = self.wraps_us {
            // The step is the shorter way around.
            step_us = (step_us + wraps_us / 2.0).rem_euclid(wraps_us) - wraps_us / 2.0;
        }
        let by_stamp_s = last.after_s + step_us * 1e-6;
        let off_s = arrived_s - by_stamp_s;
        let is_jump = off_s.abs() > RESTART_S || step_us.abs() > RESTART_S * 1e6;
        let succession = match step_us {
            _ if is_jump => Succession::Restart,
            0.0 => return (Succession::Duplicate, self.start_s + by_stamp_s),
            ..0.0 => return (Succession::Late, self.start_s + by_stamp_s),
            _ => {
                let periods = (step_us / last.duration_us.max(1.0)).round().max(1.0);
                Succession::Follows { missing: periods as u64 - 1 }
            }
        };
        let after_s = if is_jump { arrived_s } else { by_stamp_s + DRIFT_SHARE * off_s };
        self.last = Some(Last { stamp_us, duration_us, after_s });
        (succession, self.start_s + after_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_US: f64 = 3.6e9;

    fn follows(missing: u64) -> Succession {
        Succession::Follows { missing }
    }

    #[test]
    fn missing_late_and_repeated_packets_are_told_apart() {
        let mut clock = PacketClock::new(Some(HOUR_US));
        let mut take = |stamp: f64| clock.take(stamp, 600.0, 50.0 + stamp * 1e-6).0;
        assert_eq!(take(1000.0), Succession::First);
        assert_eq!(take(1600.0), follows(0));
        assert_eq!(take(3401.0), follows(2));
        assert_eq!(take(3401.0), Succession::Duplicate);
        assert_eq!(take(2200.0), Succession::Late);
        assert_eq!(take(4000.0), follows(0));
    }

    #[test]
    fn the_hour_ends_and_time_goes_on() {
        let mut clock = PacketClock::new(Some(HOUR_US));
        assert_eq!(clock.take(HOUR_US - 300.0, 600.0, 7.0).1, 7.0);
        let (succession, time_s) = clock.take(300.0, 600.0, 7.0006);
        assert_eq!(succession, follows(0));
        assert!((time_s - 7.0006).abs() < 1e-9);
    }

    #[test]
    fn a_jump_of_either_clock_is_a_restart() {
        for (stamp_us, arrival_s) in [(5e6, 10.001), (1600.0, 60.0), (1600.0, 2.0), (1e9, 10.001)] {
            let mut clock = PacketClock::new(Some(HOUR_US));
            clock.take(2e6, 600.0, 10.0);
            assert_eq!(clock.take(stamp_us, 600.0, arrival_s), (Succession::Restart, arrival_s));
        }
    }

    /// Times stay within the precision of an f64 over many packets.
    #[test]
    fn clocks_that_agree_stay_so_to_the_microsecond() {
        let mut clock = PacketClock::new(Some(HOUR_US));
        for packet in 0..100_000u64 {
            let sent_us = (packet as f64 * 663.552).round();
            let arrival_s = 1.79e9 + sent_us * 1e-6;
            let (_, time_s) = clock.take(sent_us, 663.552, arrival_s);
            assert!((time_s - arrival_s).abs() < 5e-7, "packet {packet}: {time_s}");
        }
    }

    /// The host's clock is faster by 50 ppm, and packets arrive up to 2 ms late.
    #[test]
    fn clocks_that_drift_apart_stay_together() {
        let mut clock = PacketClock::new(Some(HOUR_US));
        let mut worst_s = 0.0f64;
        for packet in 0..2_000_000u64 {
            let sent_s = packet as f64 * 600e-6;
            let late_s = (packet * 7 % 5) as f64 * 5e-4;
            let arrival_s = sent_s * (1.0 + 50e-6) + late_s;
            let (_, time_s) = clock.take(sent_s * 1e6 % HOUR_US, 600.0, arrival_s);
            worst_s = worst_s.max((time_s - arrival_s).abs());
        }
        assert!(worst_s < 0.003, "{worst_s} s apart");
    }
}
