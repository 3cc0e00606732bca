//! Captures of UDP packets in the formats of tcpdump and Wireshark.
//!
//! The classic libpcap format: a header of 24 bytes, then each frame after one
//! of 16 (<https://ietf-opsawg-wg.github.io/draft-ietf-opsawg-pcap/draft-ietf-opsawg-pcap.html>).
//! This module writes these two headers itself, and those of the frames with `etherparse`. It reads
//! the classic format and pcapng with `pcap-parser`. Packets that are longer than a frame come in
//! fragments (RFC 791, RFC 8200), which are joined.

use std::borrow::Cow;
use std::fmt::{self, Display};
use std::fs::File;
use std::io::{self, Read, Write};
use std::net::IpAddr;
use std::ops::ControlFlow;
use std::path::Path;

use etherparse::defrag::IpDefragBuf;
use etherparse::{
    EtherType, IpNumber, Ipv6ExtensionSlice, NetSlice, PacketBuilder, SlicedPacket, TransportSlice,
    UdpSlice,
};
use pcap_parser::traits::PcapNGPacketBlock;
use pcap_parser::{Block, Linktype, PIB_MAGIC, PcapBlockOwned, PcapError, create_reader};

use crate::counted;
use crate::error::FormatError;
use crate::plausible::{foreign, or_foreign_file};

/// The magic number of a file in this byte order with times in microseconds.
const MAGIC: u32 = 0xa1b2_c3d4;
const VERSION: [u16; 2] = [2, 4];
/// The longest frame, so that no frame is cut.
const SNAP_LENGTH: u32 = 65535;
const ETHERNET: u32 = 1;

/// Routers that a broadcast may pass: the default of operating systems.
const TIME_TO_LIVE: u8 = 64;

pub(crate) struct Origin {
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
    sender: &Origin,
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

/// What tells the sensors apart that send to one program: the address, and in captures the ports, since
/// sensors behind a relay have one address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender {
    /// The address.
    pub ip: IpAddr,
    /// The source and the destination port; 0 where they do not matter.
    pub ports: [u16; 2],
}

/// A UDP packet of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct UdpPacket<'a> {
    /// The time of capture, seconds of Unix time, if the capture has it.
    pub time_s: Option<f64>,
    /// Who sent it.
    pub sender: Sender,
    /// The payload.
    pub payload: Cow<'a, [u8]>,
}

/// What a capture has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// UDP packets that were passed on.
    pub packets: u64,
    /// UDP packets that lack a fragment.
    pub incomplete: u64,
    /// Frames that were cut by a snap length or have an unknown link type.
    pub unread: u64,
    /// The number of the first of these, from 0, and its flaw.
    pub first_unread: Option<(usize, String)>,
    /// UDP packets that are probably missing in a turn of a sensor, by the times of the others.
    pub missing: u64,
    /// UDP packets that a decoder of the sensor's data refused.
    pub flawed: u64,
    /// The number of the first of these among the UDP packets, from 0, and its flaw.
    pub first_flawed: Option<(u64, String)>,
}

/// What was not read, for the end of a sentence; nothing if all was.
impl Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.incomplete > 0 {
            write!(f, ", beside {} without all fragments", self.incomplete)?;
        }
        if let Some((first, flaw)) = &self.first_unread {
            let frames = counted(self.unread, "frame");
            write!(f, ", beside {frames} that cannot be read (the first, {first}: {flaw})")?;
        }
        if let Some((first, flaw)) = &self.first_flawed {
            let n = self.flawed;
            write!(f, ", {n} of them flawed and not used (the first, UDP packet {first}: {flaw})")?;
        }
        Ok(())
    }
}

/// Passes each UDP packet of the capture at `path`, pcap or pcapng, to `each` until it breaks.
/// Other packets and invalid ones are skipped. Counts what was read so far.
///
/// # Errors
/// A file that cannot be read, is not a capture, ends within a frame, or has no UDP packet but
/// frames that were cut or have an unknown link type.
pub fn read(
    path: &Path,
    each: impl FnMut(&UdpPacket<'_>) -> ControlFlow<()>,
) -> Result<Counts, FormatError> {
    if path.is_dir() {
        return Err(FormatError::malformed(path, "name", "expected a capture, found a folder"));
    }
    let file = File::open(path).map_err(|source| match path.to_str() {
        Some("-") => {
            let cause = "expected a file, found standard input: write it to a file first";
            FormatError::malformed(path, "name", cause)
        }
        _ => FormatError::io(path, source),
    })?;
    read_from(file, path, each).map_err(|error| or_foreign_file(path, "a capture", error))
}

/// As [`read`], from `capture`, which errors call `name`.
///
/// # Errors
/// As [`read`].
pub fn read_from(
    capture: impl Read + Send,
    name: &Path,
    mut each: impl FnMut(&UdpPacket<'_>) -> ControlFlow<()>,
) -> Result<Counts, FormatError> {
    let flaw = |part: String, cause: String| FormatError::malformed(name, part, cause);
    let mut reader = create_reader(CAPACITY, capture)
        .map_err(|error| flaw("header".to_owned(), words(&error)))?;
    let (mut interfaces, mut fragments, mut number) = (Vec::new(), Fragments::default(), 0);
    let (mut counts, mut has_blocks) = (Counts::default(), false);
    loop {
        let part = || format!("frame {number}");
        if has_blocks && begins_with_short_block(reader.data()) {
            return Err(flaw(part(), "expected a block of 12 bytes or more".to_owned()));
        }
        match reader.next() {
            Ok((size, block)) => {
                has_blocks |= matches!(block, PcapBlockOwned::NG(_));
                if let Some(frame) = Frame::in_block(&block, &mut interfaces) {
                    match frame.udp_packet(number, &mut fragments) {
                        Ok(Some(packet)) => {
                            counts.packets += 1;
                            if each(&packet).is_break() {
                                return Ok(counts);
                            }
                        }
                        Ok(None) => {}
                        Err(cause) => {
                            counts.unread += 1;
                            counts.first_unread.get_or_insert((number, cause));
                        }
                    }
                    number += 1;
                }
                reader.consume(size);
            }
            Err(PcapError::Eof) => {
                counts.incomplete = fragments.given_up + fragments.unfinished.len() as u64;
                return match counts.first_unread {
                    Some((first, cause)) if counts.packets == 0 => {
                        Err(flaw(format!("frame {first}"), cause))
                    }
                    _ => Ok(counts),
                };
            }
            Err(PcapError::Incomplete(_)) => {
                reader.refill().map_err(|error| flaw(part(), words(&error)))?;
            }
            Err(error) => return Err(flaw(part(), words(&error))),
        }
    }
}

/// Whether the data of a pcapng begin with a block of process information that says to be shorter
/// than its own header: pcap-parser 0.17.0 subtracts the header's 12 bytes without a check.
fn begins_with_short_block(data: &[u8]) -> bool {
    let Some(&[kind, length]) = data.as_chunks::<4>().0.first_chunk() else { return false };
    let is_short = |of: fn([u8; 4]) -> u32| of(kind) == PIB_MAGIC && of(length) < 12;
    is_short(u32::from_le_bytes) || is_short(u32::from_be_bytes)
}

/// Whether the file at `path` is a capture by its extension or its first bytes.
#[must_use]
pub fn is_capture(path: &Path) -> bool {
    let is_named = |end: &str| path.extension().is_some_and(|it| it.eq_ignore_ascii_case(end));
    let mut start = [0; 4];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    let is_sign = || foreign(&start).is_some_and(|found| found.starts_with("a capture"));
    ["pcap", "pcapng", "cap"].into_iter().any(is_named) || (read.is_ok() && is_sign())
}

#[derive(Clone, Copy)]
struct Interface {
    link: Linktype,
    /// The start of its clock in seconds of Unix time, and ticks of that clock in a second.
    clock: (f64, f64),
}

struct Frame<'a> {
    link: Linktype,
    time_s: Option<f64>,
    bytes: &'a [u8],
    /// Bytes of the frame on the wire.
    size: u32,
}

impl<'a> Frame<'a> {
    /// The frame in a block, if it holds one. `interfaces` are those of the blocks before.
    fn in_block(block: &'a PcapBlockOwned<'_>, interfaces: &mut Vec<Interface>) -> Option<Self> {
        match block {
            PcapBlockOwned::LegacyHeader(header) => {
                let ticks = if header.is_nanosecond_precision() { 1e9 } else { 1e6 };
                *interfaces = vec![Interface { link: header.network, clock: (0.0, ticks) }];
            }
            PcapBlockOwned::NG(Block::SectionHeader(_)) => interfaces.clear(),
            PcapBlockOwned::NG(Block::InterfaceDescription(interface)) => {
                // The highest bit tells powers of two from powers of ten (pcapng, if_tsresol).
                let base: f64 = if interface.if_tsresol & 0x80 == 0 { 10.0 } else { 2.0 };
                let ticks = base.powi(i32::from(interface.if_tsresol & 0x7f));
                let clock = (interface.if_tsoffset as f64, ticks);
                interfaces.push(Interface { link: interface.linktype, clock });
            }
            PcapBlockOwned::Legacy(packet) => {
                let &Interface { link, clock: (_, ticks) } = interfaces.first()?;
                let time_s = Some(f64::from(packet.ts_sec) + f64::from(packet.ts_usec) / ticks);
                return Some(Self { link, time_s, bytes: packet.data, size: packet.origlen });
            }
            PcapBlockOwned::NG(Block::EnhancedPacket(packet)) => {
                let &Interface { link, clock } = interfaces.get(packet.if_id as usize)?;
                let ticks = u64::from(packet.ts_high) << 32 | u64::from(packet.ts_low);
                let time_s = Some(clock.0 + ticks as f64 / clock.1);
                let (bytes, size) = (packet.packet_data(), packet.origlen);
                return Some(Self { link, time_s, bytes, size });
            }
            PcapBlockOwned::NG(Block::SimplePacket(packet)) => {
                let link = interfaces.first()?.link;
                let (bytes, size) = (packet.packet_data(), packet.origlen);
                return Some(Self { link, time_s: None, bytes, size });
            }
            PcapBlockOwned::NG(_) => {}
        }
        None
    }

    /// The headers of the frame, or `None` if they are not those of IP.
    ///
    /// # Errors
    /// A link type that is not known (<https://www.tcpdump.org/linktypes.html>).
    fn sliced(&self) -> Result<Option<SlicedPacket<'a>>, String> {
        // The upper half of the classic header's field has flags.
        let (ether_type_at, size) = match self.link.0 & 0xffff {
            1 => (Some(12), 14),
            // Linux cooked, versions 1 and 2: what `tcpdump -i any` writes.
            113 => (Some(14), 16),
            276 => (Some(0), 20),
            // BSD loopback: the address family, in either byte order, before the IP header.
            0 | 108 => (None, 4),
            // Raw IP.
            12 | 14 | 101 | 228 | 229 => (None, 0),
            found => {
                return Err(format!(
                    "expected Ethernet, Linux cooked, loopback or raw IP, found link type {found}"
                ));
            }
        };
        let Some((header, rest)) = self.bytes.split_at_checked(size) else { return Ok(None) };
        Ok(match ether_type_at {
            None => SlicedPacket::from_ip(rest).ok(),
            Some(at) => {
                let kind = EtherType(u16::from_be_bytes([header[at], header[at + 1]]));
                SlicedPacket::from_ether_type(kind, rest).ok()
            }
        })
    }

    /// The UDP packet that the frame holds or, as its last fragment, completes.
    ///
    /// # Errors
    /// As [`Frame::sliced`]; a frame that was cut.
    fn udp_packet(
        &self,
        number: usize,
        fragments: &mut Fragments,
    ) -> Result<Option<UdpPacket<'a>>, String> {
        let Some(packet) = self.sliced()? else {
            let (size, found) = (self.size, self.bytes.len());
            if (found as u64) < u64::from(size) {
                return Err(format!(
                    "expected {size} bytes, found {found}, since the capture has a snap length: \
                     capture whole frames (`tcpdump -s 0`)"
                ));
            }
            return Ok(None);
        };
        let ip = match &packet.net {
            Some(NetSlice::Ipv4(ip)) => ip.header().source_addr().into(),
            Some(NetSlice::Ipv6(ip)) => ip.header().source_addr().into(),
            _ => return Ok(None),
        };
        let packet_with = |udp: &UdpSlice<'_>, payload| UdpPacket {
            time_s: self.time_s,
            sender: Sender { ip, ports: [udp.source_port(), udp.destination_port()] },
            payload,
        };
        if packet.is_ip_payload_fragmented() {
            let joined = packet.net.as_ref().and_then(|net| fragments.join(net, number));
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

/// Packets that are joined at the same time: those of a few senders, of up to 64 KiB each.
const AT_ONCE: usize = 16;

/// Frames within which a sender does not repeat an identification of 16 bits.
const REPEATS: usize = 60_000;

/// Incomplete UDP packets, oldest first.
#[derive(Default)]
struct Fragments {
    unfinished: Vec<Unfinished>,
    /// The number of packets that were discarded.
    given_up: u64,
}

struct Unfinished {
    /// Source, destination and identification.
    key: (IpAddr, IpAddr, u32),
    /// The frame of its first fragment.
    number: usize,
    joined: IpDefragBuf,
}

impl Fragments {
    /// The packet that the fragment `ip` in frame `number` completes. Fragments of other protocols
    /// and contradictory ones are skipped.
    fn join(&mut self, ip: &NetSlice<'_>, number: usize) -> Option<Vec<u8>> {
        let (key, offset, more, payload) = match ip {
            NetSlice::Ipv4(ip) => {
                let header = ip.header();
                let [source, destination] = [header.source_addr(), header.destination_addr()];
                let key = (source.into(), destination.into(), header.identification().into());
                (key, header.fragments_offset(), header.more_fragments(), ip.payload())
            }
            NetSlice::Ipv6(ip) => {
                let [source, destination] =
                    [ip.header().source_addr(), ip.header().destination_addr()];
                let part = ip.extensions().clone().into_iter().find_map(|header| match header {
                    Ipv6ExtensionSlice::Fragment(part) => Some(part),
                    _ => None,
                })?;
                let key = (source.into(), destination.into(), part.identification());
                (key, part.fragment_offset(), part.more_fragments(), ip.payload())
            }
            NetSlice::Arp(_) => return None,
        };
        if payload.ip_number != IpNumber::UDP {
            return None;
        }
        let full = self.unfinished.len() == AT_ONCE;
        if self.unfinished.first().is_some_and(|one| full || number - one.number > REPEATS) {
            self.unfinished.remove(0);
            self.given_up += 1;
        }
        let at = self.unfinished.iter().position(|one| one.key == key).unwrap_or_else(|| {
            let joined = IpDefragBuf::new(payload.ip_number, Vec::new(), Vec::new());
            self.unfinished.push(Unfinished { key, number, joined });
            self.unfinished.len() - 1
        });
        let joined = &mut self.unfinished[at].joined;
        joined.add(offset, more, payload.payload).ok()?;
        joined.is_complete().then(|| self.unfinished.remove(at).joined.take_bufs().0)
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
