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

#[cfg(test)]
mod tests {
    use super::*;

    /// A VLP-32C fires each laser every 55.296 us, turns 5 times per second at least, and has two returns.
    #[test]
    fn there_is_room_for_the_slowest_turn_with_dual_returns() {
        let mut packet = [0; 1206];
        packet[..1200].chunks_mut(100).for_each(|block| block[..2].copy_from_slice(&[0xff, 0xee]));
        packet[1204..].copy_from_slice(&[0x39, 0x28]);
        let sensor = SensorData::new(&packet, &LiveOptions::default()).unwrap();
        assert!(sensor.capacity() as f64 > 32.0 * 2.0 * 200_000.0 / 55.296);
    }
}
