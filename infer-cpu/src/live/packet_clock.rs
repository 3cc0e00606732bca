//! The times of packets: their order, losses, and Unix times.

use formats::periodic::shorter_way;

/// A gap of this length, or a step back by it, counts as a restart of the sensor.
const RESTART_S: f64 = 1.0;
/// The share of the difference between the clocks of host and sensor by which each packet corrects
/// the time. The clocks drift apart by some microseconds per second, and packets arrive with a
/// jitter of milliseconds.
const DRIFT_SHARE: f64 = 1e-3;
/// The largest drift of a quartz oscillator that is corrected in recordings.
const MOST_DRIFT: f64 = 1e-4;
/// The times of a recording disagree with the sensor's stamps if they are apart by more than this
/// jitter of a network, and this share of the time since the start.
const JITTER_S: f64 = 0.05;
const DISAGREEMENT: f64 = 0.01;

/// Follows the time stamps of one sensor.
#[derive(Clone, Debug)]
pub struct PacketClock {
    /// The period of the time stamps in microseconds, if they wrap around.
    wraps_us: Option<f64>,
    /// Whether the packets are of a recording, whose times may have been changed since: then the
    /// stamps give the intervals.
    is_recorded: bool,
    /// The Unix time of the arrival of the first packet, seconds. Steps are added up separately
    /// from Unix time, which an f64 holds to a quarter of a microsecond: rounding would add up to
    /// 100 µs in a thousand steps.
    start_s: f64,
    last: Option<Last>,
    disagreement_s: Option<[f64; 2]>,
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
    /// A clock for time stamps with a period of `wraps_us` microseconds, if they wrap around, of a
    /// sensor or its recording.
    pub fn new(wraps_us: Option<f64>, is_recorded: bool) -> Self {
        Self { wraps_us, is_recorded, start_s: 0.0, last: None, disagreement_s: None }
    }

    /// The seconds from the first packet to a later one by the times of the recording, and by the
    /// stamps, if they disagree.
    pub fn disagreement_s(&self) -> Option<[f64; 2]> {
        self.disagreement_s
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
        let step_us = stamp_us - last.stamp_us;
        let step_us = self.wraps_us.map_or(step_us, |wraps_us| shorter_way(step_us, wraps_us));
        let by_stamp_s = last.after_s + step_us * 1e-6;
        let off_s = arrived_s - by_stamp_s;
        let is_jump =
            step_us.abs() > RESTART_S * 1e6 || off_s.abs() > RESTART_S && !self.is_recorded;
        let succession = match step_us {
            _ if is_jump => Succession::Restart,
            0.0 => return (Succession::Duplicate, self.start_s + by_stamp_s),
            ..0.0 => return (Succession::Late, self.start_s + by_stamp_s),
            _ => {
                let periods = (step_us / last.duration_us.max(1.0)).round().max(1.0);
                Succession::Follows { missing: periods as u64 - 1 }
            }
        };
        let disagrees = off_s.abs() > JITTER_S + DISAGREEMENT * by_stamp_s;
        if self.is_recorded && !is_jump && disagrees {
            self.disagreement_s.get_or_insert([arrived_s, by_stamp_s]);
        }
        let most_s = if self.is_recorded { MOST_DRIFT * step_us * 1e-6 } else { f64::INFINITY };
        let after_s = match self.disagreement_s {
            None if is_jump => arrived_s,
            None => by_stamp_s + (DRIFT_SHARE * off_s).clamp(-most_s, most_s),
            // How long the sensor was off is unknown.
            Some(_) if step_us < 0.0 => last.after_s + last.duration_us * 1e-6,
            Some(_) => by_stamp_s,
        };
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
    fn missing_late_and_repeated_packets_are_distinguished() {
        let mut clock = PacketClock::new(Some(HOUR_US), false);
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
        let mut clock = PacketClock::new(Some(HOUR_US), false);
        assert_eq!(clock.take(HOUR_US - 300.0, 600.0, 7.0).1, 7.0);
        let (succession, time_s) = clock.take(300.0, 600.0, 7.0006);
        assert_eq!(succession, follows(0));
        assert!((time_s - 7.0006).abs() < 1e-9);
    }

    #[test]
    fn a_jump_of_either_clock_is_a_restart() {
        for (stamp_us, arrival_s) in [(5e6, 10.001), (1600.0, 60.0), (1600.0, 2.0), (1e9, 10.001)] {
            let mut clock = PacketClock::new(Some(HOUR_US), false);
            clock.take(2e6, 600.0, 10.0);
            assert_eq!(clock.take(stamp_us, 600.0, arrival_s), (Succession::Restart, arrival_s));
        }
    }

    /// Times stay within the precision of an f64 over many packets.
    #[test]
    fn clocks_that_agree_stay_so_to_the_microsecond() {
        let mut clock = PacketClock::new(Some(HOUR_US), false);
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
        let mut clock = PacketClock::new(Some(HOUR_US), false);
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

    /// Each packet at 1.2345 s of the stamps, whatever the recording says. Until they disagree, the
    /// times of the recording move a packet by at most 1e-4 of 0.06 s.
    #[test]
    fn in_a_recording_the_stamps_give_the_intervals() {
        let zero = |_: f64| -1000.0;
        let nanoseconds = |since_s: f64| (since_s.fract() * 1e3).floor() + since_s.floor();
        let ten_times = |since_s: f64| 10.0 * since_s;
        let fast = |since_s: f64| 0.1 * since_s;
        let host_is_set = |since_s: f64| if since_s < 0.7 { since_s } else { since_s - 100.0 };
        let all: [&dyn Fn(f64) -> f64; 5] = [&zero, &nanoseconds, &ten_times, &fast, &host_is_set];
        for (i, recorded) in all.into_iter().enumerate() {
            let mut clock = PacketClock::new(Some(HOUR_US), true);
            for packet in 0..=2000 {
                let since_s = f64::from(packet) * 600e-6;
                let arrival_s = 1000.0 + if packet == 0 { 0.0 } else { recorded(since_s) };
                let (succession, time_s) = clock.take(since_s * 1e6, 600.0, arrival_s);
                assert!(packet == 0 || succession == follows(0), "{i} {packet}: {succession:?}");
                assert!((time_s - 1000.0 - since_s).abs() < 7e-6, "{i} {packet}: {time_s}");
            }
            let [arrived_s, stamped_s] = clock.disagreement_s().unwrap();
            assert!((arrived_s - stamped_s).abs() > 0.05, "{i}: {arrived_s} {stamped_s}");
        }
    }

    /// Each packet corrects a thousandth of what is left.
    #[test]
    fn a_live_sensor_s_time_follows_the_host_s_slowly() {
        let mut clock = PacketClock::new(Some(HOUR_US), false);
        clock.take(0.0, 600.0, 1000.0);
        let sent_s = |packet: u32| f64::from(packet) * 600e-6;
        for packet in 1..=1000 {
            let arrival_s = 1000.0 + sent_s(packet) + 0.01;
            let (_, time_s) = clock.take(sent_s(packet) * 1e6, 600.0, arrival_s);
            let expected_s = 0.01 * (1.0 - 0.999f64.powi(packet as i32));
            assert!((time_s - 1000.0 - sent_s(packet) - expected_s).abs() < 1e-6, "{packet}");
        }
    }

    #[test]
    fn a_pause_of_a_recording_is_a_restart_at_its_time_if_the_clocks_agree() {
        for (off_s, stamp_us, time_s) in [(0.0, 0.0, 17.0), (0.0, 9e6, 17.0), (3.0, 9e6, 16.0)] {
            let mut clock = PacketClock::new(Some(HOUR_US), true);
            clock.take(2e6, 600.0, 9.0);
            clock.take(3e6, 600.0, 10.0 + off_s);
            assert_eq!(clock.take(stamp_us, 600.0, 17.0), (Succession::Restart, time_s));
            assert_eq!(clock.disagreement_s().is_some(), off_s > 0.0);
        }
    }
}
