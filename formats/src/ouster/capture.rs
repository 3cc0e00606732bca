//! Reads the first whole frame of a capture as a scan.

use std::ops::ControlFlow;
use std::path::Path;

use super::{Decoder, Header, Metadata, PacketError};
use crate::capture::{Points, Senders, each_packet};
use crate::error::FormatError;
use crate::pcap::Counts;
use crate::scan::Scan;

/// Reads the first complete frame of the capture at `path`, pcap or pcapng: points in the sensor's
/// frame, ranges, rings, times in seconds since the frame's first packet, and reflectivities divided
/// by 255. UDP packets of another length than lidar packets or of another of the `senders` are
/// skipped.
///
/// # Errors
/// A file that is not such a capture or has no complete frame; a packet that cannot be decoded,
/// with its number.
pub fn read_frame(
    path: &Path,
    metadata: &Metadata,
    senders: &mut Senders,
) -> Result<(Scan, Counts), FormatError> {
    let decoder = Decoder::new(metadata);
    let (mut frame, mut most) = (Frame::default(), 0);
    let expected = usize::from(metadata.columns_per_frame - metadata.n_columns_unsent());
    let is_data = |payload: &[u8]| decoder.header(payload).is_ok();
    let counts = each_packet(path, senders, is_data, |payload| {
        if payload.len() != decoder.packet_size() {
            return Ok(ControlFlow::Continue(()));
        }
        frame.take(&decoder, metadata, payload)?;
        most = most.max(frame.n_columns);
        let is_whole = frame.n_columns == expected;
        Ok::<_, PacketError>(if is_whole {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    })?;
    if most < expected {
        let n = crate::counted(counts.packets, "UDP packet");
        let cause = format!(
            "expected a whole frame of {expected} columns, found {most} at most among {n}{senders}{counts}"
        );
        return Err(FormatError::malformed(path, "packets", cause));
    }
    Ok((frame.points.scan(), counts))
}

#[derive(Default)]
struct Frame {
    first: Option<Header>,
    received: Vec<bool>,
    /// Received columns, of those that the sensor sends.
    n_columns: usize,
    points: Points,
}

impl Frame {
    /// Adds a packet, which may begin another frame.
    fn take(
        &mut self,
        decoder: &Decoder,
        metadata: &Metadata,
        payload: &[u8],
    ) -> Result<(), PacketError> {
        let header = decoder.header(payload)?;
        if self.first.is_none_or(|first| first.frame_id != header.frame_id) {
            let received = vec![false; usize::from(header.columns_per_frame)];
            *self = Self { first: Some(header), received, ..Self::default() };
        }
        let per_frame = usize::from(header.columns_per_frame);
        let first = usize::from(metadata.column_window[0]);
        let n_sent = per_frame - usize::from(metadata.n_columns_unsent());
        let is_sent = |column: usize| (column + per_frame - first) % per_frame < n_sent;
        let start = usize::from(header.measurement_id);
        let mut is_new = false;
        for column in start..start + usize::from(header.columns) {
            if let Some(received @ false) = self.received.get_mut(column) {
                *received = true;
                is_new = true;
                self.n_columns += usize::from(is_sent(column));
            }
        }
        // A network may deliver a packet twice.
        if is_new {
            let since = self.first.map_or(0, |first| first.time_ns);
            let packet_us = header.time_ns.saturating_sub(since) as f64 * 1e-3;
            let points = &mut self.points;
            decoder.decode(payload, |found| points.push(found, packet_us, f32::from(u8::MAX)))?;
        }
        Ok(())
    }
}
