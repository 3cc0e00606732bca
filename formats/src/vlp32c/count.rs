//! How many returns a capture holds: what tells whether a file is whole.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use super::Returns;
use super::packet::{
    BLOCK_HEADER_SIZE, BLOCK_SIZE, BLOCKS, FLAG, MEASUREMENT_SIZE, MODEL, PAYLOAD_SIZE,
};
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::pcap::{FILE_HEADER_SIZE, FRAME_HEADER_SIZE, MAGIC, PROTOCOLS_SIZE};
use crate::records;

const FRAME_SIZE: usize = PROTOCOLS_SIZE + PAYLOAD_SIZE;

/// Counts the beams that returned something in the capture at `path`, which
/// [`super::write()`] wrote: the two returns of one beam are one.
///
/// # Errors
/// A file that cannot be read or is not such a capture; the packet is named.
pub fn count_returns(path: &Path) -> Result<u64, FormatError> {
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let mut reader = BufReader::new(file);
    read_header(&mut reader).map_err(|error| error_in(path, "header", error))?;
    let (mut packet, mut count, mut flaw) = (0, 0, None);
    let rest = records::read_to_end(&mut reader, FRAME_HEADER_SIZE + FRAME_SIZE, |record| {
        match returns_in(record) {
            Ok(returns) => count += returns,
            Err(cause) => flaw = flaw.or(Some((packet, cause))),
        }
        packet += 1;
    })
    .map_err(|error| error_in(path, "packets", error))?;
    match (flaw, rest) {
        (Some((packet, cause)), _) => {
            Err(FormatError::malformed(path, format!("packet {packet}"), cause))
        }
        (None, 0) => Ok(count),
        (None, _) => {
            Err(FormatError::malformed(path, format!("packet {packet}"), "the file ends within it"))
        }
    }
}

fn read_header(reader: &mut impl Read) -> io::Result<()> {
    let mut header = [0; FILE_HEADER_SIZE];
    reader.read_exact(&mut header)?;
    if header.starts_with(&MAGIC.to_le_bytes()) {
        return Ok(());
    }
    Err(invalid("expected a little-endian capture with times in microseconds"))
}

/// The returns in a frame with its header.
fn returns_in(record: &[u8]) -> Result<u64, &'static str> {
    let (header, frame) = record.split_at(FRAME_HEADER_SIZE);
    if header[8..12] != (FRAME_SIZE as u32).to_le_bytes() {
        return Err("expected a data packet of 1248 bytes, found another length");
    }
    let payload = &frame[PROTOCOLS_SIZE..];
    let [.., mode, model] = payload else { return Err("expected a payload, found none") };
    let returns = Returns::of_byte(*mode).ok_or("unknown return mode")?;
    if *model != MODEL {
        return Err("expected a VLP-32C, found another model");
    }
    let blocks = payload.chunks_exact(BLOCK_SIZE).take(BLOCKS);
    let mut count = 0;
    for block in blocks.step_by(returns.blocks_per_sequence()) {
        let (header, measured) = block.split_at(BLOCK_HEADER_SIZE);
        if !header.starts_with(&FLAG) {
            return Err("a block does not begin with its flag");
        }
        let seen = measured.chunks_exact(MEASUREMENT_SIZE).filter(|bytes| bytes[..2] != [0, 0]);
        count += seen.count() as u64;
    }
    Ok(count)
}
