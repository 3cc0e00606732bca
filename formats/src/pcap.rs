//! Captures of UDP packets, as tcpdump and Wireshark keep them.
//!
//! The classic libpcap format: a header of 24 bytes, then each frame after one
//! of 16 (<https://ietf-opsawg-wg.github.io/draft-ietf-opsawg-pcap/draft-ietf-opsawg-pcap.html>).
//! These two are a few words each, so no crate writes them; the headers and
//! checksums inside the frames are `etherparse`'s. Captures of both formats, the classic one
//! and pcapng, are read with `pcap-parser`.

use std::fs::File;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;

use etherparse::{PacketBuilder, SlicedPacket, TransportSlice};
use pcap_parser::traits::PcapNGPacketBlock;
use pcap_parser::{Block, Linktype, PcapBlockOwned, PcapError, create_reader};

use crate::error::FormatError;

/// A file in this byte order whose times are in microseconds.
const MAGIC: u32 = 0xa1b2_c3d4;
const VERSION: [u16; 2] = [2, 4];
/// No frame was cut: longer ones than this do not exist.
const SNAP_LENGTH: u32 = 65535;
const ETHERNET: u32 = 1;

/// Routers that a broadcast may pass: what systems set by default.
const TIME_TO_LIVE: u8 = 64;

/// Who sends packets to everyone in a network.
pub(crate) struct Sender {
    pub mac: [u8; 6],
    pub ip: [u8; 4],
    /// Sent from and to.
    pub port: u16,
}

/// Writes the header of a capture, little-endian.
pub(crate) fn write_header(writer: &mut impl Write) -> io::Result<()> {
    writer.write_all(&MAGIC.to_le_bytes())?;
    for number in VERSION {
        writer.write_all(&number.to_le_bytes())?;
    }
    // Two fields that nobody uses, zero by the format's specification.
    writer.write_all(&[0; 8])?;
    writer.write_all(&SNAP_LENGTH.to_le_bytes())?;
    writer.write_all(&ETHERNET.to_le_bytes())
}

/// Writes a UDP packet that was sent to everyone at `seconds` and
/// `microseconds` of Unix time.
pub(crate) fn write_packet(
    writer: &mut impl Write,
    sender: &Sender,
    [seconds, microseconds]: [u32; 2],
    payload: &[u8],
) -> io::Result<()> {
    let packet = PacketBuilder::ethernet2(sender.mac, [0xff; 6])
        .ipv4(sender.ip, [0xff; 4], TIME_TO_LIVE)
        .udp(sender.port, sender.port);
    let mut frame = Vec::with_capacity(packet.size(payload.len()));
    let written = packet.write_to_vec(&mut frame, payload);
    written.map_err(|error| io::Error::other(error.to_string()))?;
    let size = frame.len() as u32;
    for field in [seconds, microseconds, size, size] {
        writer.write_all(&field.to_le_bytes())?;
    }
    writer.write_all(&frame)
}

/// Bytes that are held at once; no frame is longer than 64 KiB.
const CAPACITY: usize = 256 * 1024;

/// Gives the payload of each UDP packet in the capture at `path` to `each`, until that breaks.
/// Other packets, and those that make no sense, are passed over.
///
/// # Errors
/// A file that cannot be read, is no capture of Ethernet frames, or ends within a frame; a UDP
/// packet that comes in fragments.
pub(crate) fn read(
    path: &Path,
    mut each: impl FnMut(&[u8]) -> ControlFlow<()>,
) -> Result<(), FormatError> {
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let flaw = |part: String, cause: String| FormatError::malformed(path, part, cause);
    let mut reader =
        create_reader(CAPACITY, file).map_err(|error| flaw("header".to_owned(), words(&error)))?;
    let (mut links, mut number) = (Vec::new(), 0);
    loop {
        let part = || format!("frame {number}");
        match reader.next() {
            Ok((size, block)) => {
                if let Some((link, frame)) = frame(&block, &mut links) {
                    let payload = udp_payload(link, frame).map_err(|cause| flaw(part(), cause))?;
                    if payload.is_some_and(|payload| each(payload).is_break()) {
                        return Ok(());
                    }
                    number += 1;
                }
                reader.consume(size);
            }
            Err(PcapError::Eof) => return Ok(()),
            Err(PcapError::Incomplete(_)) => {
                reader.refill().map_err(|error| flaw(part(), words(&error)))?;
            }
            Err(error) => return Err(flaw(part(), words(&error))),
        }
    }
}

/// The frame in a block, if it holds one, and what link it was sent over. `links` are those of
/// the interfaces so far.
fn frame<'a>(
    block: &'a PcapBlockOwned<'_>,
    links: &mut Vec<Linktype>,
) -> Option<(Linktype, &'a [u8])> {
    match block {
        PcapBlockOwned::LegacyHeader(header) => *links = vec![header.network],
        PcapBlockOwned::NG(Block::SectionHeader(_)) => links.clear(),
        PcapBlockOwned::NG(Block::InterfaceDescription(interface)) => {
            links.push(interface.linktype)
        }
        PcapBlockOwned::Legacy(packet) => return Some((*links.first()?, packet.data)),
        PcapBlockOwned::NG(Block::EnhancedPacket(packet)) => {
            return Some((*links.get(packet.if_id as usize)?, packet.packet_data()));
        }
        PcapBlockOwned::NG(Block::SimplePacket(packet)) => {
            return Some((*links.first()?, packet.packet_data()));
        }
        PcapBlockOwned::NG(_) => {}
    }
    None
}

/// What an Ethernet frame carries by UDP, if it does.
fn udp_payload(link: Linktype, frame: &[u8]) -> Result<Option<&[u8]>, String> {
    if link != Linktype::ETHERNET {
        return Err(format!("expected Ethernet (link type 1), found link type {}", link.0));
    }
    let Ok(packet) = SlicedPacket::from_ethernet(frame) else { return Ok(None) };
    if packet.is_ip_payload_fragmented() {
        return Err("expected whole UDP packets, found a fragment of one".to_owned());
    }
    match packet.transport {
        Some(TransportSlice::Udp(udp)) => Ok(Some(udp.payload())),
        _ => Ok(None),
    }
}

fn words(error: &PcapError<&[u8]>) -> String {
    match error {
        PcapError::HeaderNotRecognized | PcapError::Eof | PcapError::Incomplete(_) => {
            "expected a capture, pcap or pcapng".to_owned()
        }
        PcapError::UnexpectedEof => "the file ends within it".to_owned(),
        PcapError::ReadError => "it cannot be read".to_owned(),
        _ => "its headers make no sense".to_owned(),
    }
}
