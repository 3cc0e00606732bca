//! The data of one sensor: its packets, their order, and the stream of its returns.

use edgepuck_segment::{Stream, StreamCluster};
use formats::geometry::Trajectory;
use formats::returns::Return;

use super::options::LiveOptions;
use super::packet_clock::PacketClock;
use super::sensor::{Decoder, Facts, Flaw};
use super::waiting::{Tag, Waiting};

/// The capacity for returns of each ring: 1.5 times as many as a VLP-32C sends in its slowest turn
/// with dual returns.
const ROOM_PER_RING: u32 = 8192;

/// The widest columns, degrees: the steps of a sensor are narrower, unless its packet is damaged.
const WIDEST_DEG: f32 = 1.0;

/// The sensor of the first packet, and its returns.
pub struct SensorStream {
    pub decoder: Decoder,
    pub clock: PacketClock,
    pub stream: Stream<Tag>,
    /// The number of foreign packets since its last packet.
    pub n_foreign: u32,
}

impl SensorStream {
    pub fn new(payload: &[u8], options: &LiveOptions) -> Result<Self, Flaw> {
        let mut decoder = Decoder::new(options.ouster.as_ref(), payload)?;
        let facts = decoder.decode(payload, &mut Vec::new())?;
        let elevations = decoder.elevations_deg();
        let n_rings = elevations.len() as u32;
        let mut settings = options.segmentation.clone();
        settings.ring_elevations_deg = Some(elevations);
        let step_deg = decoder.step_rad(&facts).to_degrees() as f32;
        settings.column_width_deg = settings.column_width_deg.max(step_deg.min(WIDEST_DEG));
        let stream = Stream::new(settings, n_rings * ROOM_PER_RING)
            .expect("invariant: settings were checked, and a sensor's elevations are right");
        let clock = PacketClock::new(decoder.wraps_us(), options.is_recorded);
        Ok(Self { decoder, clock, stream, n_foreign: 0 })
    }

    /// Passes the returns of a packet, which may follow a gap, to the stream; `packet` has its time.
    pub fn push(
        &mut self,
        facts: &Facts,
        returns: &[Return],
        (packet, is_behind_gap): (Tag, bool),
        waiting: &mut Waiting,
        motion: Option<&Trajectory>,
    ) {
        let Self { decoder, stream, .. } = self;
        let offset_rad = decoder.most_offset_rad();
        let turn = stream.n_turns();
        let mut each = |cluster: StreamCluster<'_, Tag>| waiting.push(&cluster, turn, motion);
        let start_rad = (facts.azimuth_rad - offset_rad) as f32;
        match is_behind_gap {
            true => stream.skip(start_rad, facts.n_unsent > 0, &mut each),
            false => stream.advance(start_rad, &mut each),
        }
        let mut resumes = facts.resumes;
        for found in returns {
            if let Some((_, azimuth_rad)) = resumes.take_if(|(us, _)| found.after_us >= *us) {
                stream.skip((azimuth_rad - offset_rad) as f32, true, &mut each);
            }
            let time_s = packet.time_s + found.after_us * 1e-6;
            let tag = Tag { time_s, ring: found.ring, ..packet };
            stream.push(found.point_m, found.ring, tag);
        }
        if let Some((_, azimuth_rad)) = resumes {
            stream.skip((azimuth_rad - offset_rad) as f32, true, &mut each);
        }
    }

    pub fn end(&mut self, waiting: &mut Waiting, motion: Option<&Trajectory>) {
        let turn = self.stream.n_turns();
        self.stream.end(|cluster| waiting.push(&cluster, turn, motion));
    }
}
