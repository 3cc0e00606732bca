//! The packets of one sensor, their order, and the turns of its returns.

use formats::returns::Return;

use super::options::LiveOptions;
use super::packet_clock::PacketClock;
use super::sensor::{Decoder, Facts, Flaw};
use super::turns::{Tag, Turns};

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

    /// Adds the returns of a packet, which may follow a gap, to the turns; `packet` has its time.
    pub fn push(
        turns: &mut Turns,
        facts: &Facts,
        returns: &[Return],
        (packet, is_behind_gap): (Tag, bool),
    ) {
        match is_behind_gap && facts.n_unsent > 0 {
            true => turns.pass_sector(facts.azimuth_rad),
            false => turns.advance(facts.azimuth_rad, is_behind_gap),
        }
        let mut resumes = facts.resumes;
        for found in returns {
            if let Some((_, azimuth_rad)) = resumes.take_if(|(us, _)| found.after_us >= *us) {
                turns.pass_sector(azimuth_rad);
            }
            let time_s = packet.time_s + found.after_us * 1e-6;
            turns.push(found.point_m, found.ring, Tag { time_s, ..packet });
        }
        if let Some((_, azimuth_rad)) = resumes {
            turns.pass_sector(azimuth_rad);
        }
    }
}
