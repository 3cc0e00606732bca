//! The azimuths that a sensor sends, if it was set to a part of the turn: from the first turns of a
//! capture ([`Sector`]), or as packets come ([`UnsentPackets`]).

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;

use super::packet::{LONGEST_STEP_US, TURN, forward, step_us};
use super::{Header, PacketError};
use crate::capture::{Senders, each_packet};
use crate::error::FormatError;

/// A sector whose azimuths never come is one that the sensor does not send if it is at least this
/// wide, azimuth units. A packet of a VLP-32C at 1200 rpm spans 4.8 degrees, and one is lost now and
/// then, but hardly in all turns at the same azimuth.
const LEAST_UNSENT: u16 = 300;

/// The number of azimuths.
const N: usize = TURN as usize;

/// The number of turns from which the sector is found.
const WATCHED: f64 = 4.0;
/// The fewest turns that tell a sector that is not sent from packets that are lost.
const FEWEST_WATCHED: f64 = 2.0;
/// The most packets that are read for it, since a head may stand still.
const MOST_PACKETS: u32 = 5000;

/// The sector that a sensor sends in each turn, in azimuth units of 0.01 degree, clockwise. By
/// default it is the whole turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sector {
    /// Where it begins.
    start: u16,
    /// The width of the rest of the turn, which is not sent.
    unsent: u16,
}

impl Sector {
    /// The sector of the sensor whose packets the capture at `path` has, from its first turns. It is the
    /// whole turn if the capture has fewer than two.
    ///
    /// # Errors
    /// A file that is not a capture.
    pub(crate) fn of_capture(path: &Path, senders: &Senders) -> Result<Self, FormatError> {
        let mut seen = vec![false; N];
        let (mut last, mut turned, mut n_packets) = (None::<Header>, 0.0, 0);
        let is_data = |payload: &[u8]| Header::parse(payload).is_ok();
        each_packet(path, &mut senders.clone(), is_data, |payload| {
            let header = Header::parse(payload)?;
            if let Some(last) = last {
                let us = step_us(&last, &header).clamp(0.0, LONGEST_STEP_US);
                turned += last.units_per_us * us / f64::from(TURN);
            }
            last = Some(header);
            n_packets += 1;
            for (from, width) in header.spans() {
                (0..width.min(TURN))
                    .for_each(|i| seen[(usize::from(from) + usize::from(i)) % N] = true);
            }
            let is_enough = turned > WATCHED || n_packets > MOST_PACKETS;
            Ok::<_, PacketError>(match is_enough {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            })
        })?;
        Ok(if turned < FEWEST_WATCHED { Self::default() } else { Self::of_seen(&seen) })
    }

    /// The sector around the widest gap of the azimuths that were `seen`.
    fn of_seen(seen: &[bool]) -> Self {
        let (mut widest, mut gap) = (Self::default(), 0);
        // Twice around, for a gap across the azimuth 0.
        for (azimuth, is_seen) in seen.iter().chain(seen).enumerate() {
            if *is_seen && gap > widest.unsent {
                widest = Self { start: (azimuth % seen.len()) as u16, unsent: gap };
            }
            gap = if *is_seen { 0 } else { (gap + 1).min(TURN) };
        }
        if widest.unsent < LEAST_UNSENT { Self::default() } else { widest }
    }

    /// Azimuth units of the turn that are not sent.
    pub(super) fn unsent(&self) -> f64 {
        self.unsent.into()
    }

    /// How far the start of a turn's first packet is from where the turn begins: the start of the sector, or
    /// this packet if the whole turn is sent. Below 0 is the sector of the turn before.
    pub(super) fn after_start(&self, azimuth: u16) -> f64 {
        // Less than a block: a turn of the sector begins with its first block, at any azimuth.
        const NEAR: u16 = 100;
        let ahead = forward(self.start, azimuth);
        match self.unsent {
            0 => 0.0,
            _ if ahead < NEAR => ahead.into(),
            _ => f64::from(ahead) - f64::from(TURN),
        }
    }

    /// Whether the head passes the rest of the turn from one azimuth to a later one of the same turn or
    /// the next.
    pub(super) fn is_passed(&self, from: u16, to: u16) -> bool {
        self.unsent > 0 && forward(self.start, to) < forward(self.start, from)
    }

    /// [`Self::after_start`] of an azimuth in radians, turns.
    pub(crate) fn since_start(&self, azimuth_rad: f64) -> f64 {
        self.after_start(units(azimuth_rad)) / f64::from(TURN)
    }
}

/// Tells packets that are not sent from those that are lost, as packets come: a sector that is not sent
/// is missing in each turn.
#[derive(Clone, Debug, Default)]
pub struct UnsentPackets {
    before: Option<Header>,
    /// Where the sector that is not sent begins and ends.
    sector: Option<(u16, u16)>,
    /// A gap that is such a sector if it comes again, and the number of its packets.
    doubtful: Option<((u16, u16), u64)>,
}

impl UnsentPackets {
    /// Those of a sensor that sends this sector only.
    pub(crate) fn outside(sector: &Sector) -> Self {
        let unsent = (forward(sector.unsent, sector.start), sector.start);
        Self { sector: (sector.unsent > 0).then_some(unsent), ..Self::default() }
    }

    /// The number of packets between the one before and this one that were not sent, and of those before
    /// that seemed to be lost and were not sent either: a gap is known when it comes again.
    pub(crate) fn take(&mut self, header: &Header) -> [u64; 2] {
        let step_us = self.before.map_or(0.0, |before| step_us(&before, header));
        if self.before.is_some() && (-LONGEST_STEP_US..=0.0).contains(&step_us) {
            return [0; 2];
        }
        self.sector = header.unsent().or(self.sector);
        let width = |(from, to)| u32::from(forward(from, to));
        let packet = (header.units_per_us * header.sending_us()) as u32;
        // A sensor may leave out whole packets: its sector then begins and ends with any of those
        // near its ends.
        let is_sent = |gap: &(u16, u16)| {
            let ahead = width((gap.0, header.azimuth));
            ahead > packet && ahead + 2 * packet < width(*gap)
        };
        self.sector = self.sector.filter(|gap| !is_sent(gap));
        self.doubtful = self.doubtful.filter(|(gap, _)| !is_sent(gap));
        let before = self.before.replace(*header).filter(|_| packet > 0 && step_us > 0.0);
        let Some(gap) = before.map(|before| (before.end(), header.azimuth)) else { return [0; 2] };
        // One packet or two are lost now and then, also at the same azimuth in two turns.
        let least = 2 * packet + u32::from(LEAST_UNSENT);
        if width(gap) <= least || forward(gap.0, gap.1) > TURN - LEAST_UNSENT {
            return [0; 2];
        }
        let within = |known: &(u16, u16)| {
            let ahead = (width((gap.0, known.0)) + packet) % u32::from(TURN);
            ahead + width(*known) <= width(gap) + 2 * packet
        };
        // Both durations are rounded, the one by stamps and this one by azimuths.
        let n_packets = |gap| {
            let us = f64::from(width(gap)) / header.units_per_us;
            (us / header.sending_us() + 0.05).round() as u64
        };
        if let Some(sector) = self.sector.filter(within) {
            let is_whole = width(gap) <= width(sector) + 2 * packet;
            return [n_packets(if is_whole { gap } else { sector }), 0];
        }
        let again = self.doubtful.take_if(|(known, _)| within(known));
        match again {
            Some((_, n_before)) => {
                self.sector = Some(gap);
                [n_packets(gap), n_before]
            }
            None => {
                self.doubtful = Some((gap, n_packets(gap)));
                [0; 2]
            }
        }
    }
}

/// A packet's azimuth, which was converted to radians.
fn units(azimuth_rad: f64) -> u16 {
    (azimuth_rad / TAU * f64::from(TURN)).round() as u16 % TURN
}
