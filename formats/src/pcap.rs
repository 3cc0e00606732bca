//! Captures of UDP packets in the formats of tcpdump and Wireshark.
//!
//! The classic libpcap format: a header of 24 bytes, then each frame after one
//! of 16 (<https://ietf-opsawg-wg.github.io/draft-ietf-opsawg-pcap/draft-ietf-opsawg-pcap.html>).
//! This module writes these two headers itself, and those of the frames with `etherparse`. It reads
//! the classic format and pcapng with `pcap-parser`. Packets that are longer than a frame come in
//! fragments (RFC 791), which are joined.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Write};
use std::net::IpAddr;
use std::ops::ControlFlow;
use std::path::Path;

use etherparse::defrag::IpDefragBuf;
use etherparse::{Ipv4Slice, NetSlice, PacketBuilder, SlicedPacket, TransportSlice, UdpSlice};
use pcap_parser::traits::PcapNGPacketBlock;
use pcap_parser::{Block, Linktype, PcapBlockOwned, PcapError, create_reader};

use crate::error::FormatError;

/// The magic number of a file in this byte order with times in microseconds.
const MAGIC: u32 = 0xa1b2_c3d4;
const VERSION: [u16; 2] = [2, 4];
/// The longest frame, so that no frame is cut.
const SNAP_LENGTH: u32 = 65535;
const ETHERNET: u32 = 1;

/// Routers that a broadcast may pass: the default of operating systems.
const TIME_TO_LIVE: u8 = 64;

pub(crate) struct Sender {
    pub mac: [u8; 6],
    pub ip: [u8; 4],
    /// The source and destination port.
    pub port: u16,
}

/// Writes the header of a capture, little-endian.
pub(crate) fn write_header(writer: &mut impl Write) -> io::Result<()> {
    writer.write_all(&MAGIC.to_le_bytes())?;
    for number in VERSION {
        writer.write_all(&number.to_le_bytes())?;
    }
    // Two unused fields, which are zero by the specification.
    writer.write_all(&[0; 8])?;
    writer.write_all(&SNAP_LENGTH.to_le_bytes())?;
    writer.write_all(&ETHERNET.to_le_bytes())
}

/// Writes a UDP broadcast packet that was sent at this Unix time.
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

/// Bytes of the reader's buffer. No frame is longer than 64 KiB.
const CAPACITY: usize = 256 * 1024;

/// A UDP packet of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct UdpPacket<'a> {
    /// The time of capture, seconds of Unix time, if the capture has it.
    pub time_s: Option<f64>,
    /// The sender.
    pub source: IpAddr,
    /// The destination port.
    pub port: u16,
    /// The payload.
    pub payload: Cow<'a, [u8]>,
}

/// Passes each UDP packet of the capture at `path`, pcap or pcapng, to `each` until it breaks.
/// Other packets and invalid ones are skipped.
///
/// # Errors
/// A file that cannot be read, is not a capture of Ethernet frames, or ends within a frame. At the
/// end of the file, a packet with missing fragments.
pub fn read(
    path: &Path,
    mut each: impl FnMut(&UdpPacket<'_>) -> ControlFlow<()>,
) -> Result<(), FormatError> {
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let flaw = |part: String, cause: String| FormatError::malformed(path, part, cause);
    let mut reader =
        create_reader(CAPACITY, file).map_err(|error| flaw("header".to_owned(), words(&error)))?;
    let (mut interfaces, mut fragments, mut number) = (Vec::new(), Fragments::default(), 0);
    loop {
        let part = || format!("frame {number}");
        match reader.next() {
            Ok((size, block)) => {
                if let Some(frame) = Frame::in_block(&block, &mut interfaces) {
                    let packet = frame.udp_packet(number, &mut fragments);
                    let packet = packet.map_err(|cause| flaw(part(), cause))?;
                    if packet.is_some_and(|packet| each(&packet).is_break()) {
                        return Ok(());
                    }
                    number += 1;
                }
                reader.consume(size);
            }
            Err(PcapError::Eof) => {
                let Some(number) = fragments.first_unfinished() else { return Ok(()) };
                return Err(flaw(format!("frame {number}"), FRAGMENT.to_owned()));
            }
            Err(PcapError::Incomplete(_)) => {
                reader.refill().map_err(|error| flaw(part(), words(&error)))?;
            }
            Err(error) => return Err(flaw(part(), words(&error))),
        }
    }
}

#[derive(Clone, Copy)]
struct Interface {
    link: Linktype,
    /// The start of its clock in seconds of Unix time, and ticks of that clock in a second.
    clock: (u64, u64),
}

struct Frame<'a> {
    link: Linktype,
    time_s: Option<f64>,
    bytes: &'a [u8],
}

impl<'a> Frame<'a> {
    /// The frame in a block, if it holds one. `interfaces` are those of the blocks before.
    fn in_block(block: &'a PcapBlockOwned<'_>, interfaces: &mut Vec<Interface>) -> Option<Self> {
        match block {
            PcapBlockOwned::LegacyHeader(header) => {
                let ticks =
                    if header.is_nanosecond_precision() { 1_000_000_000 } else { 1_000_000 };
                *interfaces = vec![Interface { link: header.network, clock: (0, ticks) }];
            }
            PcapBlockOwned::NG(Block::SectionHeader(_)) => interfaces.clear(),
            PcapBlockOwned::NG(Block::InterfaceDescription(interface)) => {
                let ticks = interface.ts_resolution().unwrap_or(1_000_000);
                let start = u64::try_from(interface.if_tsoffset).unwrap_or_default();
                interfaces.push(Interface { link: interface.linktype, clock: (start, ticks) });
            }
            PcapBlockOwned::Legacy(packet) => {
                let &Interface { link, clock: (_, ticks) } = interfaces.first()?;
                let second = f64::from(packet.ts_usec) / ticks as f64;
                let time_s = Some(f64::from(packet.ts_sec) + second);
                return Some(Self { link, time_s, bytes: packet.data });
            }
            PcapBlockOwned::NG(Block::EnhancedPacket(packet)) => {
                let &Interface { link, clock } = interfaces.get(packet.if_id as usize)?;
                let ticks = u64::from(packet.ts_high) << 32 | u64::from(packet.ts_low);
                let time_s = Some(clock.0 as f64 + ticks as f64 / clock.1 as f64);
                return Some(Self { link, time_s, bytes: packet.packet_data() });
            }
            PcapBlockOwned::NG(Block::SimplePacket(packet)) => {
                let link = interfaces.first()?.link;
                return Some(Self { link, time_s: None, bytes: packet.packet_data() });
            }
            PcapBlockOwned::NG(_) => {}
        }
        None
    }

    /// The UDP packet that the frame holds or, as its last fragment, completes.
    fn udp_packet(
        &self,
        number: usize,
        fragments: &mut Fragments,
    ) -> Result<Option<UdpPacket<'a>>, String> {
        if self.link != Linktype::ETHERNET {
            let found = self.link.0;
            return Err(format!("expected Ethernet (link type 1), found link type {found}"));
        }
        let Ok(packet) = SlicedPacket::from_ethernet(self.bytes) else { return Ok(None) };
        let source = match &packet.net {
            Some(NetSlice::Ipv4(ip)) => ip.header().source_addr().into(),
            Some(NetSlice::Ipv6(ip)) => ip.header().source_addr().into(),
            _ => return Ok(None),
        };
        let packet_with = |udp: &UdpSlice<'_>, payload| UdpPacket {
            time_s: self.time_s,
            source,
            port: udp.destination_port(),
            payload,
        };
        if packet.is_ip_payload_fragmented() {
            let Some(NetSlice::Ipv4(fragment)) = &packet.net else {
                return Err(FRAGMENT.to_owned());
            };
            let joined = fragments.join(fragment, number);
            let udp = joined.as_deref().and_then(|joined| UdpSlice::from_slice(joined).ok());
            return Ok(udp.map(|udp| packet_with(&udp, Cow::Owned(udp.payload().to_vec()))));
        }
        match packet.transport {
            Some(TransportSlice::Udp(udp)) => {
                Ok(Some(packet_with(&udp, Cow::Borrowed(udp.payload()))))
            }
            _ => Ok(None),
        }
    }
}

const FRAGMENT: &str = "expected whole UDP packets, found a fragment of one";

/// Packets that are joined at the same time: those of a few senders, of up to 64 KiB each.
const AT_ONCE: usize = 16;

/// Frames within which a sender does not repeat an identification of 16 bits.
const REPEATS: usize = 60_000;

/// Incomplete UDP packets, oldest first.
#[derive(Default)]
struct Fragments {
    unfinished: Vec<Unfinished>,
    /// The first frame of the first packet that was discarded.
    given_up: Option<usize>,
}

struct Unfinished {
    /// Source, destination and identification.
    key: ([u8; 4], [u8; 4], u16),
    /// The frame of its first fragment.
    number: usize,
    joined: IpDefragBuf,
}

impl Fragments {
    /// The packet that `fragment` in frame `number` completes. Fragments of other protocols and
    /// contradictory ones are skipped.
    fn join(&mut self, fragment: &Ipv4Slice<'_>, number: usize) -> Option<Vec<u8>> {
        let (header, payload) = (fragment.header(), fragment.payload());
        if payload.ip_number != etherparse::IpNumber::UDP {
            return None;
        }
        let key = (header.source(), header.destination(), header.identification());
        let full = self.unfinished.len() == AT_ONCE;
        if self.unfinished.first().is_some_and(|one| full || number - one.number > REPEATS) {
            let oldest = self.unfinished.remove(0);
            self.given_up.get_or_insert(oldest.number);
        }
        let at = self.unfinished.iter().position(|one| one.key == key).unwrap_or_else(|| {
            let joined = IpDefragBuf::new(payload.ip_number, Vec::new(), Vec::new());
            self.unfinished.push(Unfinished { key, number, joined });
            self.unfinished.len() - 1
        });
        let joined = &mut self.unfinished[at].joined;
        joined.add(header.fragments_offset(), header.more_fragments(), payload.payload).ok()?;
        joined.is_complete().then(|| self.unfinished.remove(at).joined.take_bufs().0)
    }

    /// The first frame of the first packet that was never completed.
    fn first_unfinished(&self) -> Option<usize> {
        self.given_up.or_else(|| self.unfinished.first().map(|one| one.number))
    }
}

fn words(error: &PcapError<&[u8]>) -> String {
    match error {
        PcapError::HeaderNotRecognized | PcapError::Eof | PcapError::Incomplete(_) => {
            "expected a capture, pcap or pcapng".to_owned()
        }
        PcapError::UnexpectedEof => "the file ends within the frame".to_owned(),
        PcapError::ReadError => "the file cannot be read".to_owned(),
        _ => "expected a valid header, found an invalid one".to_owned(),
    }
}
