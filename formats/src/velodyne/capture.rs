//! Reads the first turn of a capture as a scan, and counts returns.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

use super::packet::{LONGEST_STEP_US, TURN, forward, step_us};
use super::{Decoder, Header, Model, PacketError, Sector};
use crate::capture::{Points, Senders, each_packet};
use crate::error::FormatError;
use crate::pcap::Counts;
use crate::periodic::shorter_way;
use crate::returns::Kind;
use crate::scan::Scan;
use crate::vlp32c::packet::PAYLOAD_SIZE;
use crate::vlp32c::{AZIMUTH_UNIT_DEG, Returns, WHITE};

/// Counts the beams with a return in the capture of a VLP-32C at `path`. Two returns of a beam count
/// as one.
///
/// # Errors
/// A file that cannot be read or is not such a capture, with the number of the packet.
pub fn count_returns(path: &Path) -> Result<u64, FormatError> {
    let decoder = Decoder::new(Model::Vlp32c);
    let mut count = 0;
    let is_data = |payload: &[u8]| Header::parse(payload).is_ok();
    let counts = each_packet(path, &mut Senders::default(), is_data, |payload| {
        let (mut all, mut strongest) = (0, 0);
        let header = decoder.decode(payload, |found| {
            all += 1;
            strongest += u64::from(found.kind == Kind::Strongest);
        })?;
        // A beam with two different returns was counted twice.
        count += if header.returns == Returns::Dual { all - strongest } else { all };
        Ok::<_, PacketError>(ControlFlow::Continue(()))
    })?;
    match counts.first_flawed {
        Some((number, flaw)) => {
            Err(FormatError::malformed(path, format!("UDP packet {number}"), flaw))
        }
        None => Ok(count),
    }
}

/// Reads the first complete turn of a VLP-16 or VLP-32C in the capture at `path`, pcap or pcapng:
/// points in the sensor's frame, ranges, rings, times in seconds since the turn's first packet, and
/// reflectivities divided by 100. The turn of a sensor that sends a sector only is that sector. UDP
/// packets of another length or of another of the `senders` are skipped, and so are those that cannot
/// be decoded, which are counted.
///
/// # Errors
/// A file that is not such a capture or has no complete turn.
pub fn read_turn(path: &Path, senders: &mut Senders) -> Result<(Scan, Counts), FormatError> {
    let sector = Sector::of_capture(path, senders)?;
    let mut turn = Turn { sector, ..Turn::default() };
    let is_data = |payload: &[u8]| Header::parse(payload).is_ok();
    let mut counts = each_packet(path, senders, is_data, |payload| turn.take(payload))?;
    // Rounding may lose a unit.
    if !turn.is_complete && turn.end() < f64::from(TURN) - sector.unsent() - 1.0 {
        let found = match turn.decoder {
            None => "none".to_owned(),
            Some(_) => format!("{:.1} degrees of one", turn.end().max(0.0) * AZIMUTH_UNIT_DEG),
        };
        let n = crate::counted(counts.packets, "UDP packet");
        let cause = format!(
            "expected a turn of a VLP-16 or VLP-32C, found {found} among {n}{senders}{counts}"
        );
        return Err(FormatError::malformed(path, "packets", cause));
    }
    counts.missing = turn.n_missing();
    Ok((turn.points.scan(), counts))
}

#[derive(Default)]
struct Turn {
    sector: Sector,
    decoder: Option<Decoder>,
    /// The last packet by its time, its start in azimuth units after that of the turn, and
    /// microseconds after the first packet of the turn.
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
        let (mut start, mut time_us) = (self.sector.after_start(header.azimuth), 0.0);
        if let Some((last, last_start, last_us)) = self.last {
            let step_us = step_us(&last, &header);
            if self.is_gap(&last, step_us) {
                *self = Self { sector: self.sector, ..Self::default() };
            } else {
                start = last_start + turned(&last, &header, step_us);
                time_us = last_us + step_us;
            }
            if start >= f64::from(TURN) {
                self.stamps.insert(stamp);
                self.is_complete = true;
                return Ok(ControlFlow::Break(()));
            }
            if time_us < 0.0 || last_start >= 0.0 && start < 0.0 {
                return Ok(ControlFlow::Continue(()));
            }
        }
        if start + header.units_per_us * header.duration_us() <= 0.0 && start < 0.0 {
            // Of the turn before.
            self.last = Some((header, start, 0.0));
            return Ok(ControlFlow::Continue(()));
        }
        self.stamps.insert(stamp);
        if self.last.is_none_or(|(_, _, last_us)| time_us >= last_us) {
            self.last = Some((header, start, time_us));
        }
        let Self { decoder, points, .. } = self;
        let decoder = decoder.get_or_insert_with(|| Decoder::new(header.model));
        decoder.decode(payload, |found| {
            // A firing at the border is on its later side, whatever the rounding.
            let turned = start + header.units_per_us * found.after_us + 1e-6;
            if (0.0..f64::from(TURN)).contains(&turned) {
                points.push(found, time_us, f32::from(WHITE));
            }
        })?;
        Ok(ControlFlow::Continue(()))
    }

    /// Whether azimuths no longer tell how far the head turned in a step after `last`.
    fn is_gap(&self, last: &Header, step_us: f64) -> bool {
        let most = f64::from(TURN) / 4.0 + self.sector.unsent();
        step_us.abs() > LONGEST_STEP_US || last.units_per_us * step_us > most
    }

    /// The number of packets that fit into the gaps between the times of the packets, without those that
    /// the sensor does not send.
    fn n_missing(&self) -> u64 {
        let Some((last, ..)) = self.last else { return 0 };
        let in_gap = |((from_us, from), (to_us, to)): (&(u32, u16), &(u32, u16))| {
            let us = f64::from(to_us - from_us);
            let unsent = if self.sector.is_passed(*from, *to) { self.sector.unsent() } else { 0.0 };
            let sending_us = if unsent > 0.0 { us - unsent / last.units_per_us } else { us };
            // A longer step is from the end of an hour to its start.
            let is_gap = us < LONGEST_STEP_US;
            let n = (sending_us / last.sending_us()).round() as u64;
            if is_gap { n.saturating_sub(1) } else { 0 }
        };
        self.stamps.iter().zip(self.stamps.iter().skip(1)).map(in_gap).sum()
    }

    /// Azimuth units from the start of the turn to the end of the last packet.
    fn end(&self) -> f64 {
        self.last.map_or(0.0, |(last, start, _)| start + last.units_per_us * last.duration_us())
    }
}

/// How far the head turned from one packet to another, azimuth units: as its azimuths say, by the way
/// around that is next to its speed.
fn turned(from: &Header, to: &Header, step_us: f64) -> f64 {
    let ahead = f64::from(forward(from.azimuth, to.azimuth));
    let off = shorter_way(ahead - from.units_per_us * step_us, f64::from(TURN));
    let turned = from.units_per_us * step_us + off;
    // A head that starts or stops may seem to turn backwards.
    if step_us < 0.0 { turned.min(0.0) } else { turned.max(0.0) }
}
