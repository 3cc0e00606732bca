use formats::returns::Return;

use super::arrival::Arrival;
use super::options::LiveOptions;
use super::packet_clock::{PacketClock, Succession};
use super::sensor::Decoder;

/// The times at which the packets of one sensor were sent, as a
/// [`Pipeline`](super::Pipeline) with the same options finds them.
pub struct Timeline {
    options: LiveOptions,
    sensor: Option<(Decoder, PacketClock)>,
    returns: Vec<Return>,
    span_s: Option<[f64; 2]>,
}

impl Timeline {
    /// A timeline without packets.
    #[must_use]
    pub fn new(options: &LiveOptions) -> Self {
        Self { options: options.clone(), sensor: None, returns: Vec::new(), span_s: None }
    }

    /// Adds a packet and returns when it was sent, seconds of Unix time; packets that are not the
    /// sensor's data are skipped.
    pub fn take(&mut self, payload: &[u8], arrival: Arrival) -> Option<f64> {
        let Self { options, sensor, returns, span_s } = self;
        if sensor.is_none() {
            let decoder = Decoder::new(options.ouster.as_ref(), payload).ok();
            *sensor = decoder.map(|decoder| {
                let clock = PacketClock::new(decoder.wraps_us(), options.is_recorded);
                (decoder, clock)
            });
        }
        let (decoder, clock) = sensor.as_mut()?;
        let facts = decoder.decode(payload, returns).ok()?;
        let (succession, time_s) =
            clock.take(facts.stamp_us, facts.duration_us, arrival.likely().time_s);
        if !matches!(succession, Succession::Duplicate | Succession::Late) {
            let [first_s, last_s] = span_s.get_or_insert([time_s; 2]);
            (*first_s, *last_s) = (first_s.min(time_s), last_s.max(time_s));
        }
        Some(time_s)
    }

    /// The times of the first and the last packet, seconds of Unix time.
    #[must_use]
    pub fn span_s(&self) -> Option<[f64; 2]> {
        self.span_s
    }
}
