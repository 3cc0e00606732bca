//! The packets of one sensor, and their order.

use super::options::LiveOptions;
use super::packet_clock::PacketClock;
use super::sensor::{Decoder, Flaw};

/// The room for the returns of each ring: 1.5 times as many as a VLP-32C sends in its slowest turn with
/// dual returns.
const ROOM_PER_RING: usize = 8192;

/// The sensor of the first packet.
pub struct SensorData {
    pub decoder: Decoder,
    pub clock: PacketClock,
    /// The number of foreign packets since its last packet.
    pub n_foreign: u32,
}

impl SensorData {
    pub fn new(payload: &[u8], options: &LiveOptions) -> Result<Self, Flaw> {
        let decoder = Decoder::new(options.ouster.as_ref(), payload)?;
        let clock = PacketClock::new(decoder.wraps_us(), options.is_recorded);
        Ok(Self { decoder, clock, n_foreign: 0 })
    }

    /// The most points of a turn.
    pub fn capacity(&self) -> usize {
        self.decoder.elevations_deg().len() * ROOM_PER_RING
    }
}
