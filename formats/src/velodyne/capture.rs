//! Reads the first turn of a capture as a scan, and counts returns.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

use super::packet::{TURN, advance};
use super::{Decoder, Header, Model, PacketError};
use crate::capture::{Points, Senders, each_packet};
use crate::error::FormatError;
use crate::pcap::Counts;
use crate::periodic::shorter_way;
use crate::returns::Kind;
use crate::scan::Scan;
use crate::vlp32c::packet::PAYLOAD_SIZE;
use crate::vlp32c::{AZIMUTH_UNIT_DEG, HOUR_US, Returns, WHITE};

/// Longer steps are gaps, even if the head stands still, microseconds.
const LONGEST_STEP_US: f64 = 1e6;

/// Counts the beams with a return in the capture of a VLP-32C at `path`. Two returns of a beam count
/// as one.
///
/// # Errors
/// A file that cannot be read or is not such a capture, with the number of the packet.
pub fn count_returns(path: &Path) -> Result<u64, FormatError> {
    let decoder = Decoder::new(Model::Vlp32c);
    let mut count = 0;
    let is_data = |payload: &[u8]| Header::parse(payload).is_ok();
    each_packet(path, &mut Senders::default(), is_data, |payload| {
        let (mut all, mut strongest) = (0, 0);
        let header = decoder.decode(payload, |found| {
            all += 1;
            strongest += u64::from(found.kind == Kind::Strongest);
        })?;
        // A beam with two different returns was counted twice.
        count += if header.returns == Returns::Dual { all - strongest } else { all };
        Ok::<_, PacketError>(ControlFlow::Continue(()))
    })?;
    Ok(count)
}

/// Reads the first complete turn of a VLP-16 or VLP-32C in the capture at `path`, pcap or pcapng:
/// points in the sensor's frame, ranges, rings, times in seconds since the first packet, and
/// reflectivities divided by 100. UDP packets of another length or of another of the `senders` are
/// skipped.
///
/// # Errors
/// A file that is not such a capture or has no complete turn; a packet that cannot be decoded,
/// with its number.
pub fn read_turn(path: &Path, senders: &mut Senders) -> Result<(Scan, Counts), FormatError> {
    let mut turn = Turn::default();
    let is_data = |payload: &[u8]| Header::parse(payload).is_ok();
    let mut counts = each_packet(path, senders, is_data, |payload| turn.take(payload))?;
    // Rounding may lose a unit.
    if !turn.is_complete && turn.end() < f64::from(TURN) - 1.0 {
        let found = match turn.decoder {
            None => "none".to_owned(),
            Some(_) => format!("{:.1} degrees of one", turn.end() * AZIMUTH_UNIT_DEG),
        };
        let n = counts.packets;
        let cause = format!(
            "expected a turn of a VLP-16 or VLP-32C, found {found} among {n} UDP \
             packets{senders}{counts}"
        );
        return Err(FormatError::malformed(path, "packets", cause));
    }
    counts.missing = turn.n_missing();
    Ok((turn.points.scan(), counts))
}

#[derive(Default)]
struct Turn {
    decoder: Option<Decoder>,
    /// The last packet by its time, its start in azimuth units after that of the first packet, and
    /// microseconds after it.
    last: Option<(Header, f64, f64)>,
    /// The times and azimuths of the packets.
    stamps: BTreeSet<(u32, u16)>,
    /// Whether a packet of the next turn has come.
    is_complete: bool,
    points: Points,
}

impl Turn {
    /// Adds a packet, or breaks if the turn was complete before it. A network may deliver packets
    /// twice and in another order. After a gap, a turn begins.
    fn take(&mut self, payload: &[u8]) -> Result<ControlFlow<()>, PacketError> {
        if payload.len() != PAYLOAD_SIZE {
            return Ok(ControlFlow::Continue(()));
        }
        let header = Header::parse(payload)?;
        let stamp = (header.time_us, header.azimuth);
        if self.stamps.contains(&stamp) {
            return Ok(ControlFlow::Continue(()));
        }
        let (mut start, mut time_us) = (0.0, 0.0);
        if let Some((last, last_start, last_us)) = self.last {
            let step_us = step_us(&last, &header);
            let turned = if step_us < 0.0 {
                -f64::from(advance(header.azimuth, last.azimuth))
            } else {
                f64::from(advance(last.azimuth, header.azimuth))
            };
            (start, time_us) = (last_start + turned, last_us + step_us);
            if is_gap(&last, step_us) {
                *self = Self::default();
                (start, time_us) = (0.0, 0.0);
            } else if start >= f64::from(TURN) {
                self.stamps.insert(stamp);
                self.is_complete = true;
                return Ok(ControlFlow::Break(()));
            } else if start < 0.0 || time_us < 0.0 {
                return Ok(ControlFlow::Continue(()));
            }
        }
        self.stamps.insert(stamp);
        if self.last.is_none_or(|(_, _, last_us)| time_us >= last_us) {
            self.last = Some((header, start, time_us));
        }
        let Self { decoder, points, .. } = self;
        let decoder = decoder.get_or_insert_with(|| Decoder::new(header.model));
        decoder.decode(payload, |found| {
            if start + header.units_per_us * found.after_us < f64::from(TURN) {
                points.push(found, time_us, f32::from(WHITE));
            }
        })?;
        Ok(ControlFlow::Continue(()))
    }

    /// The number of packets that fit into the gaps between the times of the packets.
    fn n_missing(&self) -> u64 {
        let Some((last, ..)) = self.last else { return 0 };
        let times = || self.stamps.iter().map(|(time_us, _)| f64::from(*time_us));
        let steps = times().zip(times().skip(1)).map(|(from, to)| to - from);
        let in_gap = |us: f64| ((us / last.duration_us()).round() as u64).saturating_sub(1);
        // A longer step is from the end of an hour to its start.
        steps.filter(|us| *us < LONGEST_STEP_US).map(in_gap).sum()
    }

    /// Azimuth units from the start of the first packet to the end of the last.
    fn end(&self) -> f64 {
        self.last.map_or(0.0, |(last, start, _)| start + last.units_per_us * last.duration_us())
    }
}

/// Microseconds from one packet to another, by the shorter way around the hour.
fn step_us(from: &Header, to: &Header) -> f64 {
    shorter_way(f64::from(to.time_us) - f64::from(from.time_us), HOUR_US as f64)
}

/// Whether azimuths no longer tell how far the head turned in a step after `last`.
fn is_gap(last: &Header, step_us: f64) -> bool {
    step_us.abs() > LONGEST_STEP_US || last.units_per_us * step_us > f64::from(TURN) / 4.0
}
