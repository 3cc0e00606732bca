use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use formats::hash::Hashing;
use formats::packets;
use formats::pcap;
use formats::points_file::PointsReader;
use formats::turns::read_turns;
use formats::velodyne::{Decoder, Header, Model, count_returns, read_turn};
use formats::vlp32c::{Returns, Revolution, write};
use formats::{FormatError, Scan, Senders};
use test_support::{need, shared_data};

/// 600 revolutions a minute: 1808 whole sequences and 14 beams.
const REVOLUTION: Revolution = Revolution { rpm: 600.0, n_beams: 57_870 };

/// The headers of the file, of a frame, and of Ethernet, IPv4 and UDP in it.
const FILE: usize = 24;
const FRAME: usize = 16;
const PROTOCOLS: usize = 42;

fn range_m(beam: u32) -> f32 {
    1.0 + beam as f32 * 1e-3
}

/// A capture of one turn in which every beam returns.
fn capture(folder: &Path, returns: Returns) -> PathBuf {
    let n = REVOLUTION.n_beams;
    let scan = Scan {
        positions: vec![[0.0; 3]; n as usize],
        beam: Some((0..n).collect()),
        range_m: Some((0..n).map(range_m).collect()),
        ..Scan::default()
    };
    let path = folder.join("turn.pcap");
    write(&path, Hashing::None, &REVOLUTION, returns, &scan).unwrap();
    path
}

/// Of the lasers in the order of packets: elevations and azimuth offsets in degrees, and how far below
/// beams through the origin they lie, in tenths of a millimetre. ROS's velodyne_pointcloud,
/// params/VLP16db.yaml, whose `vert_correction`s are exact degrees.
const VLP16: [&[f64]; 3] = [
    &[-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0],
    &[0.0; 16],
    &[
        -112.0, 7.0, -97.0, 22.0, -81.0, 37.0, -66.0, 51.0, -51.0, 66.0, -37.0, 81.0, -22.0, 97.0,
        -7.0, 112.0,
    ],
];

/// As [`VLP16`]: VLP-32C User Manual 63-9325, table of laser angles; beams cross 42.4 mm in front of
/// the axis.
const VLP32C: [&[f64]; 3] = [
    &[
        -25.0, -1.0, -1.667, -15.639, -11.31, 0.0, -0.667, -8.843, -7.254, 0.333, -0.333, -6.148,
        -5.333, 1.333, 0.667, -4.0, -4.667, 1.667, 1.0, -3.667, -3.333, 3.333, 2.333, -2.667, -3.0,
        7.0, 4.667, -2.333, -2.0, 15.0, 10.333, -1.333,
    ],
    &[
        -1.4, 4.2, -1.4, 1.4, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -4.2, 1.4,
        -1.4, 4.2, -1.4, 4.2, -4.2, 1.4, -1.4, 1.4, -1.4, 1.4, -1.4, 4.2, -4.2, 1.4, -1.4, 1.4,
    ],
    &[
        -198.0, -7.0, -12.0, -119.0, -85.0, 0.0, -5.0, -66.0, -54.0, 2.0, -2.0, -46.0, -40.0, 10.0,
        5.0, -30.0, -35.0, 12.0, 7.0, -27.0, -25.0, 25.0, 17.0, -20.0, -22.0, 52.0, 35.0, -17.0,
        -15.0, 114.0, 77.0, -10.0,
    ],
];

/// A packet of a head that stands still at 30 degrees, in which every laser measures 5 m.
fn standing(model: u8, unit_mm: u16) -> Vec<u8> {
    let mut packet = Vec::new();
    for _ in 0..12 {
        packet.extend([0xff, 0xee]);
        packet.extend(3000u16.to_le_bytes());
        for laser in 0..32 {
            packet.extend((5000 / unit_mm).to_le_bytes());
            packet.push(laser);
        }
    }
    packet.extend([0, 0, 0, 0, 0x37, model]);
    packet
}

#[test]
fn each_laser_points_where_the_manual_says_and_fires_when_it_says() {
    let both = [
        (Model::Vlp16, standing(0x22, 2), VLP16, 1),
        (Model::Vlp32c, standing(0x28, 4), VLP32C, 2),
    ];
    for (model, packet, lasers, at_once) in both {
        let mut found = Vec::new();
        Decoder::new(model).decode(&packet, |it| found.push(*it)).unwrap();
        assert_eq!(found.len(), 12 * 32, "{model}");
        for (i, found) in found.iter().enumerate() {
            let (sequence, laser) = (i / lasers[0].len(), i % lasers[0].len());
            let [elevation_deg, offset_deg, below] = lasers.map(|column| column[laser]);
            let azimuth_rad = (30.0 - offset_deg).to_radians();
            let (flat_m, up) = (5.0 * elevation_deg.to_radians().cos(), elevation_deg.to_radians());
            let expected = [
                flat_m * azimuth_rad.cos(),
                -flat_m * azimuth_rad.sin(),
                5.0 * up.sin() - below * 1e-4,
            ];
            // The table has tenths of a millimetre.
            let off_m = [0, 1, 2].map(|axis| f64::from(found.point_m[axis]) - expected[axis]);
            assert!(off_m.iter().all(|m| m.abs() < 6e-5), "{model} laser {laser}: {off_m:?}");
            let lower = lasers[0].iter().filter(|other| **other < elevation_deg).count();
            let fires_us = 55.296 * sequence as f64 + 2.304 * (laser / at_once) as f64;
            assert_eq!((found.range_m, usize::from(found.ring)), (5.0, lower), "{model} {laser}");
            assert_eq!(usize::from(found.reflectivity), i % 32);
            assert!((found.after_us - fires_us).abs() < 1e-9, "{model} laser {laser}");
        }
    }
}

/// A range is off by half a unit of 4 mm. An azimuth is off by half a unit of 0.01 degree, and by
/// as much as `formats::vlp32c` derives for the rate of turning: 0.0063 degree. Both, at 59 m, and
/// f32's steps: below 7 mm.
#[test]
fn a_turn_that_was_written_is_read_to_the_units_of_its_packets() {
    let folder = tempfile::tempdir().unwrap();
    for returns in Returns::ALL {
        let (scan, _) =
            read_turn(&capture(folder.path(), returns), &mut Senders::default()).unwrap();
        let path = folder.path().join("turn.pcap");
        assert_eq!(count_returns(&path).unwrap(), u64::from(REVOLUTION.n_beams), "{returns}");
        assert_eq!(scan.len(), REVOLUTION.n_beams as usize, "{returns}");
        let (ranges, rings) = (scan.range_m.as_ref().unwrap(), scan.ring.as_ref().unwrap());
        let times = scan.time_s.as_ref().unwrap();
        for beam in 0..REVOLUTION.n_beams {
            let i = beam as usize;
            assert!((ranges[i] - range_m(beam)).abs() < 0.002 + 1e-5, "{beam}");
            let (sequence, laser) = (f64::from(beam / 32), beam % 32);
            let time_us = sequence * 55.296 + f64::from(laser / 2) * 2.304;
            // Packets count whole microseconds.
            assert!((f64::from(times[i]) * 1e6 - time_us).abs() < 0.6, "{beam}: {}", times[i]);
            if laser == 5 {
                // Its beam is level, 1.4 degrees to the left of the encoder's azimuth.
                assert_eq!(rings[i], 20);
                let azimuth = time_us * 1e-6 * 10.0 * std::f64::consts::TAU - 1.4f64.to_radians();
                let range = f64::from(range_m(beam));
                let expected = [range * azimuth.cos(), -range * azimuth.sin(), 0.0];
                let apart =
                    [0, 1, 2].map(|axis| f64::from(scan.positions[i][axis]) - expected[axis]);
                let apart = apart.iter().map(|x| x * x).sum::<f64>().sqrt();
                assert!(apart < 0.007, "{beam}: {apart}");
            }
        }
    }
}

/// Headers by <https://www.tcpdump.org/linktypes.html>.
#[test]
fn links_of_packets_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = capture(folder.path(), Returns::Strongest);
    let expected = read_turn(&file, &mut Senders::default()).unwrap();
    let frames = frames(&fs::read(&file).unwrap());
    let path = folder.path().join("turn.pcap");
    let inet = 2u32;
    for (link, header, dropped) in [
        (1, vec![], 0),
        (1, [&frames[0][..12], &[0x81, 0, 0, 7, 8, 0]].concat(), 14),
        (113, [&[0, 0, 0, 1, 0, 6][..], &[9; 8], &[8, 0]].concat(), 14),
        (276, [&[8, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 6][..], &[9; 8]].concat(), 14),
        (0, inet.to_le_bytes().to_vec(), 14),
        (0, inet.to_be_bytes().to_vec(), 14),
        (108, inet.to_be_bytes().to_vec(), 14),
        (12, vec![], 14),
        (14, vec![], 14),
        (101, vec![], 14),
        (228, vec![], 14),
        // A frame check sequence of four bytes, told by the flags.
        (1 | 0x2400_0000, vec![], 0),
    ] {
        let carried: Vec<_> =
            frames.iter().map(|frame| [&header, &frame[dropped..]].concat()).collect();
        fs::write(&path, classic(link, &carried, 65_535)).unwrap();
        let (scan, counts) = read_turn(&path, &mut Senders::default()).unwrap();
        assert_eq!((scan.len(), &counts), (expected.0.len(), &expected.1), "{link}");
        assert_eq!(scan.positions, expected.0.positions, "{link}");
        fs::write(&path, pcapng_of(link as u16, &[], &carried)).unwrap();
        assert_eq!(read_turn(&path, &mut Senders::default()).unwrap().0, scan, "{link}");
    }
    let path = need!(shared_data("bug_inputs/linux_cooked.pcap"));
    let mut packets = 0;
    pcap::read(&path, |packet| {
        assert_eq!((packet.sender.ports[1], packet.payload.len()), (2368, 1206));
        packets += 1;
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(packets, 400);
}

/// Options 9 and 14 of an interface (draft-ietf-opsawg-pcapng, 4.2). 3 << 29 ticks are 1.5 s at
/// 2^-30 s.
#[test]
fn an_interface_tells_its_clock() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clock.pcapng");
    let frames = frames(&fs::read(capture(folder.path(), Returns::Strongest)).unwrap());
    let option = |code: u16, value: &[u8]| {
        let length = (value.len() as u16).to_le_bytes();
        let padding = vec![0; value.len().next_multiple_of(4) - value.len()];
        [&code.to_le_bytes()[..], &length, value, &padding].concat()
    };
    let offset = |seconds: i64| option(14, &seconds.to_le_bytes());
    let ticks = (3u64 << 29) as f64;
    for (options, expected) in [
        (vec![], ticks * 1e-6),
        (option(9, &[9]), ticks * 1e-9),
        (option(9, &[0x9e]), 1.5),
        (option(9, &[0x94]), 1536.0),
        (option(9, &[0x80]), ticks),
        ([option(9, &[0x9e]), offset(1_700_000_000)].concat(), 1_700_000_001.5),
        ([option(9, &[0x9e]), offset(-100)].concat(), -98.5),
    ] {
        let mut file = pcapng_of(1, &options, &frames[..1]);
        // The time of the only frame: after its block's kind, length and interface.
        let at = file.len() - (frames[0].len().next_multiple_of(4) + 4) - 16;
        file[at..at + 8].copy_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0x60]);
        let mut time_s = None;
        fs::write(&path, file).unwrap();
        pcap::read(&path, |packet| {
            time_s = packet.time_s;
            ControlFlow::Break(())
        })
        .unwrap();
        let time_s = time_s.unwrap();
        assert!((time_s - expected).abs() < 1e-9 * expected.abs(), "{options:?}: {time_s}");
    }
}

/// A network may deliver packets twice or in another order, and the hour may end in a turn.
#[test]
fn a_turn_is_that_of_the_packets_times() {
    let folder = tempfile::tempdir().unwrap();
    let file = capture(folder.path(), Returns::Strongest);
    let of_frames = |frames: &[Vec<u8>]| {
        let path = folder.path().join("changed.pcap");
        fs::write(&path, classic(1, frames, 65_535)).unwrap();
        read_turn(&path, &mut Senders::default()).map(|(scan, _)| scan)
    };
    let sorted = |scan: &Scan| {
        let mut rows: Vec<_> = scan.positions.iter().zip(scan.time_s.as_ref().unwrap()).collect();
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap());
        format!("{rows:?}")
    };
    let frames = frames(&fs::read(&file).unwrap());
    let expected = of_frames(&frames).unwrap();
    let repeated: Vec<_> = frames.iter().flat_map(|frame| [frame.clone(), frame.clone()]).collect();
    assert_eq!(of_frames(&repeated).unwrap(), expected);
    let echoed: Vec<_> = [&frames[..9], &frames[3..5], &frames[9..]].concat();
    assert_eq!(of_frames(&echoed).unwrap(), expected);
    // Of 1808 sequences, 12 or 6 of which fill a packet, the time of three packets is empty.
    for returns in [Returns::Strongest, Returns::Dual] {
        let frames = self::frames(&fs::read(capture(&folder.path().join("x"), returns)).unwrap());
        let gaps = [&frames[..20], &frames[21..70], &frames[72..]].concat();
        for (frames, missing) in [(&frames, 0), (&gaps, 3)] {
            fs::write(folder.path().join("gaps.pcap"), classic(1, frames, 65_535)).unwrap();
            let read = read_turn(&folder.path().join("gaps.pcap"), &mut Senders::default());
            assert_eq!(read.unwrap().1.missing, missing, "{returns}");
        }
    }
    let mut swapped = frames.clone();
    swapped.swap(7, 8);
    swapped.swap(90, 92);
    assert_eq!(sorted(&of_frames(&swapped).unwrap()), sorted(&expected));

    let mut at_the_hour = frames.clone();
    let stamp = |frame: &[u8]| {
        let bytes = <[u8; 4]>::try_from(&frame[frame.len() - 6..frame.len() - 2]).unwrap();
        u64::from(u32::from_le_bytes(bytes))
    };
    for frame in &mut at_the_hour {
        let moved = (stamp(frame) + 3_600_000_000 - stamp(&frames[40])) % 3_600_000_000;
        let at = frame.len() - 6;
        frame[at..at + 4].copy_from_slice(&(moved as u32).to_le_bytes());
    }
    assert_eq!(of_frames(&at_the_hour).unwrap(), expected);
    // A packet that comes again after more than a quarter of a turn.
    let echoed = [&frames[..60], &frames[3..4], &frames[60..]].concat();
    assert_eq!(of_frames(&echoed).unwrap(), expected);
    // The next turn, a tenth of a second later, shows that this one is complete.
    let mut next = frames.clone();
    for frame in &mut next {
        let (moved, at) = (stamp(frame) + 100_000, frame.len() - 6);
        frame[at..at + 4].copy_from_slice(&(moved as u32).to_le_bytes());
    }
    let last = frames.len() - 1;
    let without_the_last = [&frames[..last], &next].concat();
    let found = of_frames(&without_the_last).unwrap();
    assert!(found.len() < expected.len() && found.len() > expected.len() - 400);
    let mut swapped_at_the_seam = [&frames[..], &next].concat();
    swapped_at_the_seam.swap(last, last + 1);
    assert!(of_frames(&swapped_at_the_seam).unwrap().len() >= found.len());
    // What is left after a gap of a third is no turn.
    let gap = [&frames[..40], &frames[100..]].concat();
    let error = of_frames(&gap).unwrap_err().to_string();
    assert!(error.contains("degrees of one"), "{error}");
}

/// A head that turns by 0.21 degrees in a sequence of 55.296 us ends its turn 2/7 into the eleventh
/// sequence of a packet, when 7 of 16 pairs of lasers have fired.
#[test]
fn a_turn_ends_within_a_packet() {
    let folder = tempfile::tempdir().unwrap();
    let headers = &frames(&fs::read(capture(folder.path(), Returns::Strongest)).unwrap())[0];
    let frame = |number: u32| {
        let mut packet = standing(0x28, 4);
        for block in 0..12 {
            let azimuth = (21 * (12 * number + block) % 36_000) as u16;
            packet[100 * block as usize + 2..][..2].copy_from_slice(&azimuth.to_le_bytes());
        }
        let time_us = (f64::from(12 * number) * 55.296).round() as u32;
        packet[1200..1204].copy_from_slice(&time_us.to_le_bytes());
        [&headers[..PROTOCOLS], &packet].concat()
    };
    let path = folder.path().join("turn.pcap");
    fs::write(&path, classic(1, &(0..150).map(frame).collect::<Vec<_>>(), 65_535)).unwrap();
    let (scan, _) = read_turn(&path, &mut Senders::default()).unwrap();
    assert_eq!(scan.len(), (142 * 12 + 10) * 32 + 14);
}

#[test]
fn missing_packets_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pcap");
    let frames = frames(&fs::read(capture(folder.path(), Returns::Strongest)).unwrap());
    let read = |bytes: Vec<u8>| {
        fs::write(&path, bytes).unwrap();
        let read = read_turn(&path, &mut Senders::default());
        read.map_err(|error| error.to_string().split_off(path.as_os_str().len()))
    };
    let cut = "expected 1248 bytes, found 96, since the capture has a snap length: \
               capture whole frames (`tcpdump -s 0`)";
    let all = read(classic(1, &frames, 96)).unwrap_err();
    assert_eq!(all, format!(": frame 0: {cut}"));
    // A position packet of another sensor is short enough.
    let mut short = frames[0].clone();
    short.truncate(PROTOCOLS);
    short[16..18].copy_from_slice(&28u16.to_be_bytes());
    short[38..40].copy_from_slice(&8u16.to_be_bytes());
    let mixed = [&[short], &frames[..2]].concat();
    assert_eq!(
        read(classic(1, &mixed, 96)).unwrap_err(),
        format!(
            ": packets: expected a turn of a VLP-16 or VLP-32C, found none among 1 UDP packet, \
             beside 2 frames that cannot be read (the first, 1: {cut})"
        )
    );
    let unknown = read(classic(105, &frames, 65_535)).unwrap_err();
    let expected = "expected Ethernet, Linux cooked, loopback or raw IP, found link type 105";
    assert_eq!(unknown, format!(": frame 0: {expected}"));

    let whole = folder.path().join("turn.pcap");
    assert!(pcap::is_capture(&whole) && !pcap::is_capture(folder.path()));
    let unnamed = folder.path().join("unnamed");
    fs::copy(&whole, &unnamed).unwrap();
    assert!(pcap::is_capture(&unnamed));

    // The flag that more fragments follow, in a frame after the turn.
    let mut part = frames[0].clone();
    part[20] = 0x20;
    fs::write(&path, classic(1, &[frames[0].clone(), part], 65_535)).unwrap();
    let counts = pcap::read(&path, |_| ControlFlow::Continue(())).unwrap();
    assert_eq!((counts.packets, counts.incomplete), (1, 1));
    assert_eq!(counts.to_string(), ", beside 1 without all fragments");
}

/// A second sensor of the model at another address, whose ranges are the first's plus 16.384 m, and
/// another program of the network.
#[test]
fn one_of_two_sensors_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let alone = capture(folder.path(), Returns::Strongest);
    let path = folder.path().join("two.pcapng");
    let (mut second, mut both) = (Vec::new(), vec![b"\xff\xff\xff\xff\xff\xff".repeat(4)]);
    for frame in frames(&fs::read(&alone).unwrap()) {
        let mut other = frame.clone();
        other[26..30].copy_from_slice(&[10, 0, 0, 7]);
        for block in other[PROTOCOLS..][..1200].chunks_mut(100) {
            block[4..].chunks_mut(3).for_each(|range| range[1] ^= 0x10);
        }
        let mut chatter = other[..PROTOCOLS + 20].to_vec();
        chatter[16..18].copy_from_slice(&[0, 48]);
        chatter[38..40].copy_from_slice(&[0, 28]);
        chatter[29] = 9;
        both.extend([chatter, frame, other.clone()]);
        second.push(other);
    }
    fs::write(&path, pcapng(&second)).unwrap();
    let expected = [&alone, &path].map(|path| read_turn(path, &mut Senders::default()).unwrap());
    assert_ne!(expected[0].0, expected[1].0);
    fs::write(&path, pcapng(&both)).unwrap();
    let mut senders = Senders::default();
    assert_eq!(read_turn(&path, &mut senders).unwrap().0, expected[0].0);
    let n = both.len() as u64 / 3;
    let warning = format!(
        "expected packets of one sensor, found those of 192.168.1.201, which are used, and of \
         10.0.0.7 ({n} so far), which are not; --from 10.0.0.7 chooses another"
    );
    assert_eq!((senders.warning(), senders.n_dropped()), (Some(warning), 2 * n - 1));
    let mut chosen = Senders::new(Some("10.0.0.7".parse().unwrap()));
    assert_eq!(read_turn(&path, &mut chosen).unwrap().0, expected[1].0);
    assert_eq!(chosen.warning(), None);
    let error = read_turn(&path, &mut Senders::new(Some("10.0.0.1".parse().unwrap()))).unwrap_err();
    let found = format!(
        "found none among {0} UDP packets, {0} of them from other addresses than 10.0.0.1: \
         10.0.0.9, 192.168.1.201, 10.0.0.7",
        3 * n
    );
    assert!(error.to_string().ends_with(&found), "{error}");
}

/// The same two sensors behind one address: the second's packets go to another port, or come from
/// another one.
#[test]
fn ports_distinguish_sensors_of_one_address() {
    let folder = tempfile::tempdir().unwrap();
    let alone = capture(folder.path(), Returns::Strongest);
    let path = folder.path().join("two.pcapng");
    let expected = read_turn(&alone, &mut Senders::default()).unwrap().0;
    // The source port is the third word after the addresses, the destination port the fourth.
    for (place, used, other) in [
        (34, "192.168.1.201@2368", "192.168.1.201@2369"),
        (36, "192.168.1.201:2368", "192.168.1.201:2369"),
    ] {
        let mut both = Vec::new();
        for frame in frames(&fs::read(&alone).unwrap()) {
            let mut other = frame.clone();
            other[place..place + 2].copy_from_slice(&2369u16.to_be_bytes());
            for block in other[PROTOCOLS..][..1200].chunks_mut(100) {
                block[4..].chunks_mut(3).for_each(|range| range[1] ^= 0x10);
            }
            both.extend([frame, other]);
        }
        fs::write(&path, pcapng(&both)).unwrap();
        let mut senders = Senders::default();
        assert_eq!(read_turn(&path, &mut senders).unwrap().0, expected);
        let warning = senders.warning().unwrap();
        let named = format!("found those of {used}, which are used, and of {other} (");
        assert!(warning.contains(&named), "{warning}");
        assert!(warning.ends_with(&format!("--from {other} chooses another")), "{warning}");
        for (name, is_first) in [(used, true), (other, false)] {
            let mut chosen = Senders::new(Some(name.parse().unwrap()));
            assert_eq!(read_turn(&path, &mut chosen).unwrap().0 == expected, is_first, "{name}");
            assert_eq!(chosen.warning(), None);
        }
    }
    let absent = "192.168.1.201:9999".parse().unwrap();
    let error = read_turn(&path, &mut Senders::new(Some(absent))).unwrap_err().to_string();
    let found =
        "from other addresses than 192.168.1.201:9999: 192.168.1.201:2368, 192.168.1.201:2369";
    assert!(error.ends_with(found), "{error}");
    for wrong in ["192.168.1", "192.168.1.201:x", "@2368"] {
        let error = wrong.parse::<formats::ChosenSender>().unwrap_err();
        assert_eq!(error, "expected ADDRESS, ADDRESS:PORT or ADDRESS@PORT");
    }
}

#[test]
fn incomplete_turns_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = capture(folder.path(), Returns::Strongest);
    let whole = fs::read(&path).unwrap();
    let error = |bytes: &[u8]| -> String {
        let path = folder.path().join("x.pcap");
        fs::write(&path, bytes).unwrap();
        let error: FormatError = read_turn(&path, &mut Senders::default()).unwrap_err();
        error.to_string().split_once("x.pcap").unwrap().1.to_owned()
    };
    assert_eq!(error(b""), ": header: expected a capture, pcap or pcapng");
    assert_eq!(
        error(b"no capture, but long enough"),
        ": header: expected a capture, pcap or pcapng"
    );
    assert_eq!(error(&whole[..whole.len() - 1]), ": frame 150: the file ends within the frame");
    let found = error(&whole[..FILE + 70 * (FRAME + PROTOCOLS + 1206)]);
    let expected = ": packets: expected a turn of a VLP-16 or VLP-32C, found 167.2 degrees of one";
    assert_eq!(found, format!("{expected} among 70 UDP packets"));
    assert!(error(&whole[..FILE]).ends_with("found none among 0 UDP packets"));
    let mut flawed = whole.clone();
    flawed[FILE..]
        .chunks_mut(FRAME + PROTOCOLS + 1206)
        .for_each(|frame| frame[FRAME + PROTOCOLS] = 0);
    let found = error(&flawed);
    let expected =
        "of them flawed and not used (the first, UDP packet 0: block 0: expected the flag";
    assert!(found.contains("found none among 151 UDP packets, 151 of them flawed"), "{found}");
    assert!(found.contains(expected), "{found}");
}

#[test]
fn a_flawed_packet_is_skipped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let whole = fs::read(capture(folder.path(), Returns::Strongest)).unwrap();
    let path = folder.path().join("x.pcap");
    let second = FILE + 2 * FRAME + 2 * PROTOCOLS + 1206;
    let without: Vec<_> =
        [0].into_iter().chain(2..151).map(|i| frames(&whole)[i].clone()).collect();
    fs::write(&path, classic(1, &without, 65_535)).unwrap();
    let expected = read_turn(&path, &mut Senders::default()).unwrap().0;
    for (at, byte, flaw) in [
        (0, 0, "block 0: expected the flag ff ee"),
        (3, 0xff, "block 0: expected an azimuth below 36000"),
        (1204, 0, "expected the return mode 0x37"),
        (1205, 0x21, "expected a packet of a VLP-16"),
        (1205, 0x22, "expected a packet of a vlp32c, found one of a vlp16"),
    ] {
        let mut bytes = whole.clone();
        bytes[second + at] = byte;
        fs::write(&path, bytes).unwrap();
        let (scan, counts) = read_turn(&path, &mut Senders::default()).unwrap();
        assert!(scan.positions == expected.positions, "{flaw}");
        let (number, found) = counts.first_flawed.unwrap();
        assert!((counts.flawed, number, found.starts_with(flaw)) == (1, 1, true), "{found}");
        assert!(count_returns(&path).unwrap_err().to_string().contains("UDP packet 1"));
        let mut n = 0;
        let (_, counts) = read_turns(&path, None, &mut Senders::default(), |_| {
            n += 1;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!((counts.flawed, n), (1, expected.len()), "{flaw}");
        let (_, warnings) = PointsReader::default().read(&path).unwrap();
        assert!(warnings.iter().any(|warning| warning.contains(flaw)), "{warnings:?}");
    }
}

/// Frames of a VLP-16 at 1266 rpm that sends `width` degrees clockwise from `from`, and sees a wall 10 m
/// away with every laser. Packets are filled with the blocks that it sends, as those of the sensor are, so
/// that some have blocks of two passes. Also the number of points of each pass.
fn sector(headers: &[u8], from: f64, width: f64, passes: u32) -> (Vec<Vec<u8>>, Vec<usize>) {
    const STEP_DEG: f64 = 0.84;
    let (mut blocks, mut counts) = (Vec::new(), vec![0; passes as usize]);
    for k in 0..(f64::from(passes) * 360.0 / STEP_DEG) as u32 {
        let ahead = f64::from(k) * STEP_DEG;
        if ahead % 360.0 < width {
            blocks.push((((from + ahead) * 100.0).round() as u32 % 36_000, f64::from(k) * 110.592));
            counts[(ahead / 360.0) as usize] += 32;
        }
    }
    // What does not fill a packet is not sent yet.
    let rest = blocks.chunks_exact(12).remainder().len();
    *counts.last_mut().unwrap() -= 32 * rest;
    let frame = |group: &[(u32, f64)]| {
        let mut packet = standing(0x22, 2);
        for (block, (azimuth, _)) in packet.chunks_mut(100).zip(group) {
            block[2..4].copy_from_slice(&(*azimuth as u16).to_le_bytes());
            block[4..].chunks_mut(3).for_each(|it| it[..2].copy_from_slice(&5000u16.to_le_bytes()));
        }
        packet[1200..1204].copy_from_slice(&(group[0].1.round() as u32).to_le_bytes());
        [&headers[..PROTOCOLS], &packet].concat()
    };
    (blocks.chunks_exact(12).map(frame).collect(), counts)
}

#[test]
fn a_turn_of_a_sector_is_one_pass_over_it() {
    let folder = tempfile::tempdir().unwrap();
    let headers = &frames(&fs::read(capture(folder.path(), Returns::Strongest)).unwrap())[0];
    let path = folder.path().join("sector.pcap");
    let write = |frames: &[Vec<u8>]| fs::write(&path, classic(1, frames, 65_535)).unwrap();
    for (from, width) in [
        (110.0, 140.0),
        (300.0, 120.0),
        (90.0, 180.0),
        (10.0, 200.0),
        (200.0, 270.0),
        (350.0, 340.0),
    ] {
        let (frames, counts) = sector(headers, from, width, 5);
        write(&frames);
        let (scan, found) = read_turn(&path, &mut Senders::default()).unwrap();
        assert_eq!((scan.len(), found.missing), (counts[0], 0), "{from} {width}");
        let ahead = |[x, y, _]: [f32; 3]| {
            (-f64::from(y).atan2(x.into()).to_degrees() - from + 5.0).rem_euclid(360.0) - 5.0
        };
        let all = scan.positions.iter().map(|point| ahead(*point));
        assert!(all.clone().fold(0.0, f64::max) < width + 1.0, "{from} {width}");
        assert!(all.fold(360.0, f64::min) > -1.0, "{from} {width}");
        let last = scan.time_s.unwrap().into_iter().fold(0.0, f32::max);
        let pass_s = width / 0.84 * 110.592e-6;
        assert!((f64::from(last) - pass_s).abs() < 3e-4, "{from} {width}: {last} {pass_s}");

        let mut turns = vec![0; counts.len()];
        let (_, found) = read_turns(&path, None, &mut Senders::default(), |turned| {
            turns[turned.turn as usize] += 1;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!((turns, found.missing), (counts.clone(), 0), "{from} {width}");

        // A capture that begins within a pass has the next one, and a lost packet of it is counted.
        let mut late = frames[5..].to_vec();
        write(&late);
        assert_eq!(read_turn(&path, &mut Senders::default()).unwrap().0.len(), counts[1]);
        late.remove(counts[0].div_ceil(12 * 32) - 5 + 4);
        write(&late);
        let (scan, found) = read_turn(&path, &mut Senders::default()).unwrap();
        assert_eq!((scan.len(), found.missing), (counts[1] - 12 * 32, 1), "{from} {width}");
        let mut gaps = 0;
        let (_, found) = read_turns(&path, None, &mut Senders::default(), |turned| {
            gaps = turned.gaps;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(found.missing == 1 && gaps > 0, "{from} {width}: {gaps}");
        // As packets come, the first gap is known to be of the sector when it comes again: here of a
        // sensor that sends no packet with blocks of two passes.
        let azimuth = |frame: &[u8], block: usize| {
            let at = PROTOCOLS + 100 * block + 2;
            i32::from(u16::from_le_bytes([frame[at], frame[at + 1]]))
        };
        let is_of_one =
            |frame: &&Vec<u8>| (azimuth(frame, 11) - azimuth(frame, 0)).rem_euclid(36_000) < 1000;
        let mut decoder = packets::Decoder::new(None, &frames[0][PROTOCOLS..]).unwrap();
        let mut gaps = [vec![], vec![]];
        for frame in frames.iter().filter(is_of_one) {
            let facts = decoder.decode(&frame[PROTOCOLS..], &mut Vec::new()).unwrap();
            for (gaps, n) in gaps.iter_mut().zip([facts.n_unsent, facts.n_unsent_before]) {
                gaps.extend(Some(n).filter(|n| *n > 0));
            }
        }
        let [unsent, before] = gaps;
        assert_eq!([unsent.len(), before.len()], [3, 1], "{from} {width}: {unsent:?} {before:?}");
        assert!(before[0].abs_diff(unsent[0]) <= 1, "{from} {width}: {unsent:?} {before:?}");
    }
}

#[test]
fn a_capture_of_a_sector_from_the_developers_is_read_pass_by_pass() {
    let path = need!(shared_data("bug_inputs/fov140_vlp16.pcap"));
    let (scan, counts) = read_turn(&path, &mut Senders::default()).unwrap();
    // 167 blocks of 32 firings.
    assert_eq!((scan.len(), counts.missing), (5344, 0));
}

#[test]
fn a_real_vlp16_is_read() {
    let file = need!(shared_data("real_scans/vlp16_packets_1206B.bin"));
    let packets = fs::read(file).unwrap();
    let decoder = Decoder::new(Model::Vlp16);
    let (mut n_returns, mut turned, mut before) = (0, 0, None);
    for payload in packets.chunks_exact(1206) {
        let header = decoder.decode(payload, |found| {
            n_returns += 1;
            let [x, y, z] = found.point_m.map(f64::from);
            let elevation_deg = (z / x.hypot(y)).atan().to_degrees();
            let ring_deg = f64::from(found.ring) * 2.0 - 15.0;
            // The beam crosses 42 mm off the axis: 11.2 mm at 15 degrees and at least 0.3 m.
            assert!((elevation_deg - ring_deg).abs() < 2.2, "{found:?}");
            assert!(found.after_us < 1328.0 && found.range_m < 131.07);
        });
        let Header { azimuth, units_per_us, .. } = header.unwrap();
        // 300 to 1200 turns a minute.
        assert!((0.17..0.73).contains(&units_per_us), "{units_per_us}");
        let step = before.map_or(0, |before| (u32::from(azimuth) + 36_000 - before) % 36_000);
        assert!(step < 1000, "{step}");
        turned += step;
        before = Some(u32::from(azimuth));
    }
    assert!(n_returns > 100_000 && turned > 36_000, "{n_returns} {turned}");
}

fn frames(file: &[u8]) -> Vec<Vec<u8>> {
    let mut rest = &file[FILE..];
    let mut frames = Vec::new();
    while !rest.is_empty() {
        let length = u32::from_le_bytes([rest[8], rest[9], rest[10], rest[11]]) as usize;
        frames.push(rest[FRAME..FRAME + length].to_vec());
        rest = &rest[FRAME + length..];
    }
    frames
}

#[test]
fn a_block_that_is_shorter_than_its_header_is_an_error() {
    for (kind, length) in [
        (0x8000_0001_u32.to_le_bytes(), 4_u32.to_le_bytes()),
        (0x8000_0001_u32.to_be_bytes(), 11_u32.to_be_bytes()),
    ] {
        let file = [&pcapng(&[])[..], &kind, &length, &[0; 8]].concat();
        let read = pcap::read_from(&file[..], Path::new("-"), |_| ControlFlow::Continue(()));
        let error = read.unwrap_err().to_string();
        assert!(error.contains("expected a block of 12 bytes or more"), "{error}");
    }
}

/// The same as pcapng: a section, an Ethernet interface, and an enhanced packet block each
/// (draft-ietf-opsawg-pcapng).
pub fn pcapng(frames: &[Vec<u8>]) -> Vec<u8> {
    pcapng_of(1, &[], frames)
}

fn pcapng_of(link: u16, options: &[u8], frames: &[Vec<u8>]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| -> Vec<u8> {
        let length = (body.len() as u32 + 12).to_le_bytes();
        [&kind.to_le_bytes(), &length[..], body, &length].concat()
    };
    let section = [&0x1a2b_3c4d_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xff; 8]].concat();
    let mut file = block(0x0a0d_0d0a, &section);
    file.extend(block(1, &[&link.to_le_bytes(), &[0, 0, 0, 0, 4, 0][..], options].concat()));
    for frame in frames {
        let length = (frame.len() as u32).to_le_bytes();
        let padding = vec![0; frame.len().next_multiple_of(4) - frame.len()];
        file.extend(block(6, &[&[0; 12][..], &length, &length, frame, &padding].concat()));
    }
    file
}

/// A classic capture of `frames`, of which it has the first `most` bytes.
fn classic(link: u32, frames: &[Vec<u8>], most: usize) -> Vec<u8> {
    let words =
        |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    let mut file = words(&[0xa1b2_c3d4, 0x0004_0002, 0, 0, 65_535, link]);
    for frame in frames {
        let kept = frame.len().min(most);
        file.extend(words(&[0, 0, kept as u32, frame.len() as u32]));
        file.extend(&frame[..kept]);
    }
    file
}
