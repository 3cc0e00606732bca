//! Captures of a sensor's packets: their first turn as a scan, and how many returns they hold.

use std::ops::ControlFlow;
use std::path::Path;

use super::packet::{TURN, advance};
use super::{Decoder, Header, Model, PacketError};
use crate::error::FormatError;
use crate::pcap;
use crate::scan::Scan;
use crate::vlp32c::packet::PAYLOAD_SIZE;
use crate::vlp32c::{AZIMUTH_UNIT_DEG, Returns};

/// Counts the beams that returned something in the capture of a VLP-32C at `path`: the two
/// returns of one beam are one.
///
/// # Errors
/// A file that cannot be read or is not such a capture; the packet is named.
pub fn count_returns(path: &Path) -> Result<u64, FormatError> {
    let decoder = Decoder::new(Model::Vlp32c);
    let mut count = 0;
    each_packet(path, |payload| {
        let (mut all, mut strongest) = (0, 0);
        let header = decoder.decode(payload, |found| {
            all += 1;
            strongest += u64::from(found.kind == Returns::Strongest);
        })?;
        // Of a beam with two different returns, both were given.
        count += if header.returns == Returns::Dual { all - strongest } else { all };
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(count)
}

/// Reads the first whole turn of a VLP-16 or VLP-32C in the capture at `path`, pcap or pcapng: points
/// in the sensor's frame, ranges, rings, times in seconds since the first packet, and reflectivities
/// in parts of 100. UDP packets of another length are not the sensor's data, and are passed over.
///
/// # Errors
/// A file that is not such a capture or holds no whole turn; a packet that cannot be decoded,
/// by its number.
pub fn read_turn(path: &Path) -> Result<Scan, FormatError> {
    let mut turn = Turn::default();
    let n_packets = each_packet(path, |payload| turn.take(payload))?;
    // A unit may be lost to rounding.
    if turn.end() < f64::from(TURN) - 1.0 {
        let found = match turn.decoder {
            None => format!("none among {n_packets} UDP packets"),
            Some(_) => format!("{:.1} degrees of one", turn.end() * AZIMUTH_UNIT_DEG),
        };
        let cause = format!("expected a turn of a VLP-16 or VLP-32C, found {found}");
        return Err(FormatError::malformed(path, "packets", cause));
    }
    Ok(turn.scan())
}

/// Gives each UDP packet of a capture to `take`, until that breaks; the number of packets.
fn each_packet(
    path: &Path,
    mut take: impl FnMut(&[u8]) -> Result<ControlFlow<()>, PacketError>,
) -> Result<usize, FormatError> {
    let (mut n_packets, mut flaw) = (0, None);
    pcap::read(path, |packet| {
        n_packets += 1;
        take(packet.payload).unwrap_or_else(|cause| {
            flaw = Some(cause);
            ControlFlow::Break(())
        })
    })?;
    match flaw {
        None => Ok(n_packets),
        Some(cause) => {
            Err(FormatError::malformed(path, format!("UDP packet {}", n_packets - 1), cause))
        }
    }
}

/// A turn while it is read.
#[derive(Default)]
struct Turn {
    decoder: Option<Decoder>,
    /// The packet before.
    before: Option<Header>,
    /// Where the last packet began, azimuth units since the first one began.
    start: f64,
    /// Microseconds since the first packet.
    time_us: f64,
    positions: Vec<[f32; 3]>,
    ranges_m: Vec<f32>,
    rings: Vec<u16>,
    times_s: Vec<f32>,
    intensities: Vec<f32>,
}

impl Turn {
    /// Adds a packet, unless the turn was whole before.
    fn take(&mut self, payload: &[u8]) -> Result<ControlFlow<()>, PacketError> {
        if payload.len() != PAYLOAD_SIZE {
            return Ok(ControlFlow::Continue(()));
        }
        let header = Header::of(payload)?;
        if let Some(before) = self.before {
            self.start += f64::from(advance(before.azimuth, header.azimuth));
            if self.start >= f64::from(TURN) {
                return Ok(ControlFlow::Break(()));
            }
            // Past the hour, counting begins anew.
            self.time_us += f64::from(header.time_us.saturating_sub(before.time_us));
        }
        self.before = Some(header);
        let Self {
            decoder, start, time_us, positions, ranges_m, rings, times_s, intensities, ..
        } = self;
        let decoder = decoder.get_or_insert_with(|| Decoder::new(header.model));
        decoder.decode(payload, |found| {
            if *start + header.units_per_us * found.after_us >= f64::from(TURN) {
                return;
            }
            positions.push(found.point_m);
            ranges_m.push(found.range_m);
            rings.push(found.ring);
            times_s.push(((*time_us + found.after_us) * 1e-6) as f32);
            intensities.push(f32::from(found.reflectivity) / 100.0);
        })?;
        Ok(ControlFlow::Continue(()))
    }

    /// Where the last packet ended.
    fn end(&self) -> f64 {
        let span = |last: Header| last.units_per_us * last.duration_us();
        self.start + self.before.map_or(0.0, span)
    }

    fn scan(self) -> Scan {
        Scan {
            positions: self.positions,
            range_m: Some(self.ranges_m),
            ring: Some(self.rings),
            time_s: Some(self.times_s),
            intensity: Some(self.intensities),
            ..Scan::default()
        }
    }
}
