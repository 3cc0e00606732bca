//! Captures of UDP packets, as tcpdump and Wireshark keep them.
//!
//! The classic libpcap format: a header of 24 bytes, then each frame after one
//! of 16 (<https://ietf-opsawg-wg.github.io/draft-ietf-opsawg-pcap/draft-ietf-opsawg-pcap.html>).
//! These two are a few words each, so no crate writes them; the headers and
//! checksums inside the frames are `etherparse`'s.

use std::io::{self, Write};

use etherparse::PacketBuilder;

/// A file in this byte order whose times are in microseconds.
pub(crate) const MAGIC: u32 = 0xa1b2_c3d4;
const VERSION: [u16; 2] = [2, 4];
/// No frame was cut: longer ones than this do not exist.
const SNAP_LENGTH: u32 = 65535;
const ETHERNET: u32 = 1;

/// Bytes of the file's header.
pub(crate) const FILE_HEADER_SIZE: usize = 24;
/// Bytes before each frame.
pub(crate) const FRAME_HEADER_SIZE: usize = 16;
/// Bytes of Ethernet's, IPv4's and UDP's headers.
pub(crate) const PROTOCOLS_SIZE: usize = 14 + 20 + 8;

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
