//! Reads all turns of a capture, return by return.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;

use crate::capture::{Senders, each_packet};
use crate::error::FormatError;
use crate::packets::{Decoder, Facts, PacketError};
use crate::pcap::Counts;
use crate::periodic::shorter_way;
use crate::returns::{Kind, Return};
use crate::{ouster, velodyne};

/// A return, and how far the head had turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedReturn {
    /// The strongest return of a beam, unless the sensor sends the last one only.
    pub found: Return,
    /// Clockwise turns up to the direction of the return. The fraction is its azimuth, clockwise
    /// from x.
    pub turns: f64,
    /// The number of the turn in which it was fired, from 0. Turns begin where the first packet does, those
    /// of a sensor that sends a sector only at the start of the sector, and an Ouster's at its first
    /// column.
    pub turn: u64,
    /// Time since the first packet, seconds.
    pub time_s: f64,
    /// The number of gaps between packets before it.
    pub gaps: u32,
}

/// Passes the returns of the capture at `path` to `each` until it breaks: of the sensor with these
/// `metadata` or, without them, of a VLP-16 or VLP-32C, whose model it returns. Packets of another
/// length, of another of the `senders`, or not later than those before are skipped, and so are those that
/// cannot be decoded, which are counted.
///
/// # Errors
/// A file that is not a capture or has no packet of such a sensor.
pub fn read_turns(
    path: &Path,
    metadata: Option<&ouster::Metadata>,
    senders: &mut Senders,
    mut each: impl FnMut(&TurnedReturn) -> ControlFlow<()>,
) -> Result<(Option<velodyne::Model>, Counts), FormatError> {
    let size = match metadata {
        Some(metadata) => ouster::Decoder::new(metadata).packet_size(),
        None => crate::vlp32c::packet::PAYLOAD_SIZE,
    };
    let sector = match metadata {
        Some(_) => velodyne::Sector::default(),
        None => velodyne::Sector::of_capture(path, senders)?,
    };
    let (mut decoder, mut head, mut lost) = (None::<Decoder>, None::<Head>, 0);
    let mut start = None;
    let mut found = Vec::new();
    let is_data = |payload: &[u8]| payload.len() == size;
    let mut counts = each_packet(path, senders, is_data, |payload| {
        if payload.len() != size {
            return Ok(ControlFlow::Continue(()));
        }
        let decoder = match &mut decoder {
            Some(decoder) => decoder,
            None => decoder.insert(Decoder::new(metadata, payload)?.of_sector(&sector)),
        };
        let facts = decoder.decode(payload, &mut found)?;
        // Of two returns of a beam, the strongest is used, or the first of an Ouster.
        let is_last_only = found.iter().all(|found| found.kind == Kind::Last);
        let is_used = |kind| kind != Kind::Second && (kind != Kind::Last || is_last_only);
        found.retain(|found| is_used(found.kind));
        let Some(now) =
            head.map_or(Some(Head::first(facts)), |head| head.advanced(facts, decoder.wraps_us()))
        else {
            return Ok(ControlFlow::Continue(()));
        };
        if let Some(before) = head
            && now.gaps > before.gaps
        {
            let step = (now.time_us - before.time_us) / before.facts.duration_us;
            lost += (step.round() as u64).saturating_sub(1 + facts.n_unsent);
            lost = lost.saturating_sub(facts.n_unsent_before);
        }
        head = Some(now);
        let start = *start.get_or_insert_with(|| {
            let since = match metadata {
                Some(metadata) => (facts.azimuth_rad + metadata.yaw_rad()) / TAU,
                None => sector.since_start(facts.azimuth_rad),
            };
            now.turns - since.rem_euclid(1.0)
        });
        for &found in &found {
            let [x, y, _] = found.point_m.map(f64::from);
            // Adding 1.5 makes the whole numbers round to the nearest.
            let ahead =
                ((-libm::atan2(y, x) - facts.azimuth_rad) / TAU + 1.5).rem_euclid(1.0) - 0.5;
            let time_s = (now.time_us + found.after_us) * 1e-6;
            // A firing at the border is on its later side, whatever the rounding.
            let fired = now.turns + facts.speed_rad_us * found.after_us / TAU + 1e-9;
            let turned = TurnedReturn {
                found,
                turns: now.turns + ahead,
                turn: (fired - start) as u64,
                time_s,
                gaps: now.gaps,
            };
            if each(&turned).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok::<_, PacketError>(ControlFlow::Continue(()))
    })?;
    if head.is_none() {
        let n = crate::counted(counts.packets, "UDP packet");
        let cause = match metadata {
            Some(_) => format!("expected packets of {size} bytes, as the metadata state"),
            None => "expected packets of a VLP-16 or VLP-32C, or --metadata for an Ouster's".into(),
        };
        let cause = format!("{cause}, found none among {n}{senders}{counts}");
        return Err(FormatError::malformed(path, "packets", cause));
    }
    counts.missing = lost;
    let model = match decoder {
        Some(Decoder::Velodyne { decoder, .. }) => Some(decoder.model()),
        _ => None,
    };
    Ok((model, counts))
}

/// How far the head had turned at the start of a packet.
#[derive(Clone, Copy)]
struct Head {
    facts: Facts,
    turns: f64,
    time_us: f64,
    gaps: u32,
}

impl Head {
    fn first(facts: Facts) -> Self {
        Self { facts, turns: facts.azimuth_rad / TAU, time_us: 0.0, gaps: 0 }
    }

    /// The head at a later packet; `None` if it is not later.
    fn advanced(&self, facts: Facts, wraps_us: Option<f64>) -> Option<Self> {
        let step_us = facts.stamp_us - self.facts.stamp_us;
        let step_us = wraps_us.map_or(step_us, |wraps_us| shorter_way(step_us, wraps_us));
        // Whole turns in a gap are those at the speed before it.
        let turned = (facts.azimuth_rad - self.facts.azimuth_rad) / TAU;
        let whole = (self.facts.speed_rad_us / TAU * step_us - turned).round();
        let is_gap = step_us > 1.5 * self.facts.duration_us;
        (step_us > 0.0).then(|| Self {
            facts,
            turns: self.turns + turned + whole,
            time_us: self.time_us + step_us,
            gaps: self.gaps + u32::from(is_gap),
        })
    }
}
