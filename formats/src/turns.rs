//! Reads all turns of a capture, return by return.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;

use crate::capture::{Senders, each_packet};
use crate::error::FormatError;
use crate::pcap::Counts;
use crate::returns::{Kind, Return};
use crate::vlp32c::{AZIMUTH_UNIT_DEG, HOUR_US, Returns};
use crate::{ouster, velodyne};

/// A return, and how far the head had turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedReturn {
    /// The strongest return of a beam, unless the sensor sends the last one only.
    pub found: Return,
    /// Clockwise turns up to the direction of the return. The fraction is its azimuth, clockwise
    /// from x.
    pub turns: f64,
    /// Time since the first packet, seconds.
    pub time_s: f64,
    /// The number of gaps between packets before it.
    pub gaps: u32,
}

/// Passes the returns of the capture at `path` to `each` until it breaks: of the sensor with these
/// `metadata` or, without them, of a VLP-16 or VLP-32C, whose model it returns. Packets of another
/// length, of another of the `senders`, or not later than those before are skipped.
///
/// # Errors
/// A file that is not a capture or has no packet of such a sensor; a packet that cannot be decoded,
/// with its number.
pub fn read_turns(
    path: &Path,
    metadata: Option<&ouster::Metadata>,
    senders: &mut Senders,
    mut each: impl FnMut(&TurnedReturn) -> ControlFlow<()>,
) -> Result<(Option<velodyne::Model>, Counts), FormatError> {
    let mut decoder = metadata.map(|metadata| Decoder::Ouster {
        decoder: Box::new(ouster::Decoder::new(metadata)),
        yaw: metadata.yaw_rad() / TAU,
    });
    let size = match &decoder {
        Some(Decoder::Ouster { decoder, .. }) => decoder.packet_size(),
        _ => crate::vlp32c::packet::PAYLOAD_SIZE,
    };
    let sends_all = metadata.is_none_or(|metadata| metadata.n_columns_unsent() == 0);
    let (mut head, mut lost) = (None::<Head>, 0);
    let mut found = Vec::new();
    let is_data = |payload: &[u8]| payload.len() == size;
    let mut counts = each_packet(path, senders, is_data, |payload| {
        if payload.len() != size {
            return Ok(ControlFlow::Continue(()));
        }
        let decoder = match &mut decoder {
            Some(decoder) => decoder,
            None => decoder.insert(Decoder::of_velodyne(payload)?),
        };
        let packet = decoder.decode(payload, &mut found)?;
        let Some(now) = head.map_or(Some(Head::first(packet)), |head| head.advanced(packet)) else {
            return Ok(ControlFlow::Continue(()));
        };
        if let Some(before) = head
            && now.gaps > before.gaps
            && sends_all
        {
            let step = (now.time_us - before.time_us) / before.packet.duration_us;
            lost += (step.round() as u64).saturating_sub(1);
        }
        head = Some(now);
        for &found in &found {
            let [x, y, _] = found.point_m.map(f64::from);
            // Adding 1.5 makes the whole numbers round to the nearest.
            let ahead = (-y.atan2(x) / TAU - packet.phase + 1.5).rem_euclid(1.0) - 0.5;
            let time_s = (now.time_us + found.after_us) * 1e-6;
            let turned = TurnedReturn { found, turns: now.turns + ahead, time_s, gaps: now.gaps };
            if each(&turned).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok::<_, String>(ControlFlow::Continue(()))
    })?;
    if head.is_none() {
        let n = counts.packets;
        let cause = match metadata {
            Some(_) => format!("expected packets of {size} bytes, as the metadata state"),
            None => "expected packets of a VLP-16 or VLP-32C, or --metadata for an Ouster's".into(),
        };
        let cause = format!("{cause}, found none among {n} UDP packets{senders}{counts}");
        return Err(FormatError::malformed(path, "packets", cause));
    }
    counts.missing = lost;
    Ok((decoder.and_then(|decoder| decoder.model()), counts))
}

enum Decoder {
    Velodyne(velodyne::Decoder),
    Ouster {
        decoder: Box<ouster::Decoder>,
        /// The yaw of the lidar in the sensor's frame, turns counterclockwise.
        yaw: f64,
    },
}

/// When a packet was sent, and where the head was.
#[derive(Clone, Copy)]
struct Packet {
    stamp_us: f64,
    duration_us: f64,
    /// The azimuth of the head, turns clockwise from x.
    phase: f64,
    turns_per_us: f64,
    /// The period of the stamps, microseconds.
    wraps_us: Option<f64>,
}

impl Decoder {
    fn of_velodyne(payload: &[u8]) -> Result<Self, String> {
        let header = velodyne::Header::parse(payload).map_err(|error| error.to_string())?;
        Ok(Self::Velodyne(velodyne::Decoder::new(header.model)))
    }

    fn model(&self) -> Option<velodyne::Model> {
        match self {
            Self::Velodyne(decoder) => Some(decoder.model()),
            Self::Ouster { .. } => None,
        }
    }

    /// Decodes a packet into `returns`, one of each beam.
    fn decode(&self, payload: &[u8], returns: &mut Vec<Return>) -> Result<Packet, String> {
        returns.clear();
        match self {
            Self::Velodyne(decoder) => {
                let header = decoder.decode(payload, |found| returns.push(*found));
                let header = header.map_err(|error| error.to_string())?;
                if header.returns == Returns::Dual {
                    returns.retain(|found| found.kind != Kind::Last);
                }
                let unit = AZIMUTH_UNIT_DEG / 360.0;
                Ok(Packet {
                    stamp_us: f64::from(header.time_us),
                    duration_us: header.duration_us(),
                    phase: f64::from(header.azimuth) * unit,
                    turns_per_us: header.units_per_us * unit,
                    wraps_us: Some(HOUR_US as f64),
                })
            }
            Self::Ouster { decoder, yaw } => {
                let header = decoder.decode(payload, |found| returns.push(*found));
                let header = header.map_err(|error| error.to_string())?;
                returns.retain(|found| found.kind != Kind::Second);
                let per_turn = f64::from(header.columns_per_frame);
                Ok(Packet {
                    stamp_us: header.time_ns as f64 * 1e-3,
                    duration_us: header.duration_us,
                    phase: f64::from(header.measurement_id) / per_turn - yaw,
                    turns_per_us: f64::from(header.columns) / per_turn / header.duration_us,
                    wraps_us: None,
                })
            }
        }
    }
}

/// How far the head had turned at the start of a packet.
#[derive(Clone, Copy)]
struct Head {
    packet: Packet,
    turns: f64,
    time_us: f64,
    gaps: u32,
}

impl Head {
    fn first(packet: Packet) -> Self {
        Self { packet, turns: packet.phase, time_us: 0.0, gaps: 0 }
    }

    /// The head at a later packet; `None` if it is not later.
    fn advanced(&self, packet: Packet) -> Option<Self> {
        let mut step_us = packet.stamp_us - self.packet.stamp_us;
        if let Some(wraps_us) = packet.wraps_us {
            step_us = (step_us + wraps_us / 2.0).rem_euclid(wraps_us) - wraps_us / 2.0;
        }
        // Whole turns in a gap are those at the speed before it.
        let turned = packet.phase - self.packet.phase;
        let whole = (self.packet.turns_per_us * step_us - turned).round();
        let is_gap = step_us > 1.5 * self.packet.duration_us;
        (step_us > 0.0).then(|| Self {
            packet,
            turns: self.turns + turned + whole,
            time_us: self.time_us + step_us,
            gaps: self.gaps + u32::from(is_gap),
        })
    }
}
