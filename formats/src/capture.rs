//! Reads captures of a sensor's packets and collects their returns in a scan.

use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::Path;

use crate::error::FormatError;
use crate::pcap;
use crate::returns::Return;
use crate::scan::Scan;

/// Passes each UDP packet of a capture to `take` until it breaks; returns the number of packets.
pub(crate) fn each_packet<E: Display>(
    path: &Path,
    mut take: impl FnMut(&[u8]) -> Result<ControlFlow<()>, E>,
) -> Result<usize, FormatError> {
    let (mut n_packets, mut flaw) = (0, None);
    pcap::read(path, |packet| {
        n_packets += 1;
        take(&packet.payload).unwrap_or_else(|cause| {
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

/// The returns of a scan that is being read.
#[derive(Default)]
pub(crate) struct Points {
    positions: Vec<[f32; 3]>,
    ranges_m: Vec<f32>,
    rings: Vec<u16>,
    times_s: Vec<f32>,
    intensities: Vec<f32>,
}

impl Points {
    /// Adds a return of the packet that was sent at `packet_us`. Its reflectivity `white` is an
    /// intensity of 1.
    pub fn push(&mut self, found: &Return, packet_us: f64, white: f32) {
        self.positions.push(found.point_m);
        self.ranges_m.push(found.range_m);
        self.rings.push(found.ring);
        self.times_s.push(((packet_us + found.after_us) * 1e-6) as f32);
        self.intensities.push(f32::from(found.reflectivity) / white);
    }

    pub fn scan(self) -> Scan {
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
