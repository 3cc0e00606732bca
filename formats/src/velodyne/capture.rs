//! Reads the first turn of a capture as a scan, and counts returns.

use std::ops::ControlFlow;
use std::path::Path;

use super::packet::{TURN, advance};
use super::{Decoder, Header, Model, PacketError};
use crate::capture::{Points, Senders, each_packet};
use crate::error::FormatError;
use crate::pcap::Counts;
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
    let counts = each_packet(path, senders, is_data, |payload| turn.take(payload))?;
    // Rounding may lose a unit.
    if turn.end() < f64::from(TURN) - 1.0 {
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
    Ok((turn.points.scan(), counts))
}

#[derive(Default)]
struct Turn {
    decoder: Option<Decoder>,
    before: Option<Header>,
    /// Azimuth units from the start of the first packet to that of the last.
    start: f64,
    /// Microseconds since the first packet.
    time_us: f64,
    points: Points,
}

impl Turn {
    /// Adds a packet, or breaks if the turn was complete before it.
    fn take(&mut self, payload: &[u8]) -> Result<ControlFlow<()>, PacketError> {
        if payload.len() != PAYLOAD_SIZE {
            return Ok(ControlFlow::Continue(()));
        }
        let header = Header::parse(payload)?;
        if let Some(before) = self.before {
            self.start += f64::from(advance(before.azimuth, header.azimuth));
            if self.start >= f64::from(TURN) {
                return Ok(ControlFlow::Break(()));
            }
            // Times restart every hour.
            self.time_us += f64::from(header.time_us.saturating_sub(before.time_us));
        }
        self.before = Some(header);
        let Self { decoder, start, time_us, points, .. } = self;
        let decoder = decoder.get_or_insert_with(|| Decoder::new(header.model));
        decoder.decode(payload, |found| {
            if *start + header.units_per_us * found.after_us < f64::from(TURN) {
                points.push(found, *time_us, f32::from(WHITE));
            }
        })?;
        Ok(ControlFlow::Continue(()))
    }

    /// Azimuth units from the start of the first packet to the end of the last.
    fn end(&self) -> f64 {
        let span = |last: Header| last.units_per_us * last.duration_us();
        self.start + self.before.map_or(0.0, span)
    }
}
