//! A reader of captures that knows the layout from the manual and the RFCs, not
//! from the writer.

/// One data packet and when it was captured.
#[derive(Debug)]
pub struct Packet {
    pub captured_s: u32,
    pub captured_us: u32,
    pub blocks: Vec<Block>,
    pub past_hour_us: u32,
    pub mode: u8,
    pub model: u8,
}

#[derive(Debug, PartialEq)]
pub struct Block {
    pub azimuth: u16,
    /// Distance and reflectivity of each laser.
    pub measured: [(u16, u8); 32],
}

/// The packets of a capture, after every header and checksum in it was checked.
pub fn parse(file: &[u8]) -> Vec<Packet> {
    let (header, mut rest) = file.split_at(24);
    assert_eq!(header[..8], [0xd4, 0xc3, 0xb2, 0xa1, 2, 0, 4, 0], "libpcap 2.4, microseconds");
    assert_eq!(header[8..16], [0; 8]);
    assert!(u32_at(header, 16) >= 1248, "no frame was cut");
    assert_eq!(u32_at(header, 20), 1, "Ethernet");
    let mut packets = Vec::new();
    while !rest.is_empty() {
        let (header, after) = rest.split_at(16);
        let length = u32_at(header, 8) as usize;
        assert_eq!(u32_at(header, 12) as usize, length, "captured whole");
        let (frame, after) = after.split_at(length);
        packets.push(packet(u32_at(header, 0), u32_at(header, 4), payload(frame)));
        rest = after;
    }
    packets
}

/// What a frame carries to UDP port 2368.
fn payload(frame: &[u8]) -> &[u8] {
    assert_eq!(frame.len(), 42 + 1206);
    let (ethernet, ip) = frame.split_at(14);
    assert_eq!(ethernet[..6], [0xff; 6], "broadcast");
    assert_eq!(ethernet[12..], [8, 0], "IPv4");
    let (header, udp) = ip.split_at(20);
    assert_eq!(header[0], 0x45, "version 4, no options");
    assert_eq!(u16::from_be_bytes([header[2], header[3]]) as usize, ip.len());
    assert_eq!(header[9], 17, "UDP");
    assert_eq!(sum(header, 0), 0xffff, "RFC 791's header checksum");
    let (ports, payload) = udp.split_at(8);
    assert_eq!(ports[..4], [9, 64, 9, 64], "from and to 2368");
    assert_eq!(u16::from_be_bytes([ports[4], ports[5]]) as usize, udp.len());
    // RFC 768: over addresses, protocol, length and the datagram.
    let pseudo_header = sum(&header[12..20], 17 + udp.len() as u32);
    assert_eq!(sum(udp, u32::from(pseudo_header)), 0xffff, "RFC 768's checksum");
    payload
}

/// RFC 1071's sum in ones' complement.
fn sum(bytes: &[u8], start: u32) -> u16 {
    let words = bytes.chunks(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]])));
    let mut sum = start + words.sum::<u32>();
    while sum > 0xffff {
        sum = (sum & 0xffff) + (sum >> 16);
    }
    sum as u16
}

fn packet(captured_s: u32, captured_us: u32, payload: &[u8]) -> Packet {
    let (blocks, tail) = payload.split_at(1200);
    Packet {
        captured_s,
        captured_us,
        blocks: blocks.chunks(100).map(block).collect(),
        past_hour_us: u32_at(tail, 0),
        mode: tail[4],
        model: tail[5],
    }
}

fn block(bytes: &[u8]) -> Block {
    assert_eq!(bytes[..2], [0xff, 0xee], "the flag of each block");
    let measured = |laser: usize| {
        let at = 4 + 3 * laser;
        (u16::from_le_bytes([bytes[at], bytes[at + 1]]), bytes[at + 2])
    };
    Block {
        azimuth: u16::from_le_bytes([bytes[2], bytes[3]]),
        measured: std::array::from_fn(measured),
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
