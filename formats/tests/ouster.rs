//! Lidar packets of Ouster's sensors are read as their metadata tells. `tests/peers` compares with
//! Ouster's own programs, which write packets.

use std::fs;
use std::path::Path;

use formats::Senders;
use formats::ouster::{Decoder, Header, Metadata, Profile, read_frame};
use formats::returns::{Kind, Return};
use formats::turns::read_turns;
use formats::velodyne;
use serde_json::{Value, json};
use test_support::{need, shared_data};

use crate::velodyne::pcapng;

/// A turn has 32 columns, a packet four, a column three rows, the lowest of them first.
const COLUMNS: u16 = 32;
const ROWS_DEG: [[f64; 2]; 3] = [[-20.0, 3.0], [15.0, 0.0], [0.5, -1.5]];
const RINGS: [u16; 3] = [0, 2, 1];
/// From the axis to where beams begin, and how high the lidar frame is in the sensor's.
const ORIGIN_M: f64 = 0.0158;
const HEIGHT_M: f64 = 0.0362;

/// Ten turns a second.
const COLUMN_NS: u64 = 100_000_000 / COLUMNS as u64;
/// Unix time, as with PTP, takes all 64 bits.
const START_NS: u64 = 1_700_000_000_000_000_000;

/// In the layout of older firmware.
fn flat(profile: Profile) -> Value {
    json!({
        "beam_altitude_angles": ROWS_DEG.map(|[altitude, _]| altitude),
        "beam_azimuth_angles": ROWS_DEG.map(|[_, azimuth]| azimuth),
        "lidar_origin_to_beam_origin_mm": 1e3 * ORIGIN_M,
        "lidar_mode": "32x10",
        "lidar_to_sensor_transform":
            [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 1e3 * HEIGHT_M, 0, 0, 0, 1],
        "data_format": {
            "columns_per_frame": COLUMNS, "columns_per_packet": 4, "pixels_per_column": 3,
            "udp_profile_lidar": profile.name(), "column_window": [0, COLUMNS - 1],
        },
    })
}

fn parse(metadata: &Value) -> Result<Metadata, String> {
    let parsed = Metadata::parse(&metadata.to_string(), Path::new("m.json"));
    parsed.map_err(|error| error.to_string())
}

fn decoder(profile: Profile) -> Decoder {
    Decoder::new(&parse(&flat(profile)).unwrap())
}

/// What a pixel measures: millimetres, of which a packet of low rate tells eighths, and the
/// reflectivity, of a return and of a second one.
fn measured(column: u16, row: usize) -> [(u32, u8); 2] {
    let range = 8 * (500 + 40 * u32::from(column) + row as u32);
    [(range, column as u8), (range + 4096, 200 + row as u8)]
}

fn pixel(profile: Profile, [(first, a), (second, b)]: [(u32, u8); 2]) -> Vec<u8> {
    // Bits that are not of the range are set.
    let word = |x: u32| x.to_le_bytes();
    match profile {
        Profile::Legacy => [&word(first | 0xf << 28)[..], &[a, 9, 9, 9], &[9; 4]].concat(),
        Profile::Single => [&word(first | 0x1f << 19)[..], &[a, 9, 9, 9], &[9; 4]].concat(),
        Profile::Dual => {
            let word = |range: u32, r: u8| word(range | 0x1f << 19 | u32::from(r) << 24);
            [word(first, a), word(second, b), [9; 4], [9; 4]].concat()
        }
        Profile::LowRate => {
            word((first / 8) | (1 << 15) | (u32::from(a) << 16) | (9 << 24)).to_vec()
        }
    }
}

/// The packet of `frame` whose first column is `start`.
fn packet(profile: Profile, frame: u16, start: u16) -> Vec<u8> {
    packet_of(profile, frame, start, measured)
}

fn packet_of(
    profile: Profile,
    frame: u16,
    start: u16,
    measured: impl Fn(u16, usize) -> [(u32, u8); 2],
) -> Vec<u8> {
    let is_legacy = profile == Profile::Legacy;
    let around = if is_legacy { 0 } else { 32 };
    let mut bytes = [&[1, 0], &frame.to_le_bytes()[..], &[7; 28]].concat();
    bytes.truncate(around);
    for column in start..start + 4 {
        let nth = u64::from(frame) * u64::from(COLUMNS) + u64::from(column);
        let time_ns = START_NS + nth * COLUMN_NS;
        bytes.extend(time_ns.to_le_bytes());
        bytes.extend(column.to_le_bytes());
        match is_legacy {
            true => bytes.extend([&frame.to_le_bytes()[..], &[7; 4]].concat()),
            false => bytes.extend([1, 0]),
        }
        (0..3).for_each(|row| bytes.extend(pixel(profile, measured(column, row))));
        bytes.extend(if is_legacy { &[0xff; 4][..] } else { &[] });
    }
    bytes.extend(&vec![7; around]);
    bytes
}

/// Where a row of a column saw something, by the angles of Ouster's manual.
fn point(column: u16, row: usize, range: f64) -> [f64; 3] {
    let [altitude, azimuth] = ROWS_DEG[row].map(f64::to_radians);
    let encoder = -std::f64::consts::TAU * f64::from(column) / f64::from(COLUMNS);
    let flat = (range - ORIGIN_M) * altitude.cos();
    let x = flat * (encoder - azimuth).cos() + ORIGIN_M * encoder.cos();
    let y = flat * (encoder - azimuth).sin() + ORIGIN_M * encoder.sin();
    [-x, -y, (range - ORIGIN_M) * altitude.sin() + HEIGHT_M]
}

/// f32 holds coordinates below 16 m to half of 9.6e-7 m.
#[test]
fn every_profile_is_read_to_the_bits_of_its_packets() {
    for profile in Profile::ALL {
        let mut found = Vec::new();
        let header = decoder(profile).decode(&packet(profile, 513, 8), |it| found.push(*it));
        let expected = Header {
            frame_id: 513,
            measurement_id: 8,
            time_ns: START_NS + (513 * u64::from(COLUMNS) + 8) * COLUMN_NS,
            columns_per_frame: COLUMNS,
            columns: 4,
            valid: 0b1111,
            duration_us: 12_500.0,
        };
        assert_eq!(header.unwrap(), expected, "{profile}");
        let returns = if profile == Profile::Dual { 2 } else { 1 };
        assert_eq!(found.len(), 4 * 3 * returns, "{profile}");
        for (n, found) in found.into_iter().enumerate() {
            let (i, row, which) = (n / returns / 3, n / returns % 3, n % returns);
            let column = 8 + i as u16;
            let (mm, reflectivity) = measured(column, row)[which];
            let range = f64::from(mm) * 1e-3;
            let point = point(column, row, range);
            let apart = [0, 1, 2].map(|axis| f64::from(found.point_m[axis]) - point[axis]);
            assert!(apart.iter().all(|x| x.abs() < 4.8e-7), "{profile}: {apart:?}");
            let expected = Return {
                point_m: found.point_m,
                range_m: range as f32,
                ring: RINGS[row],
                reflectivity,
                after_us: i as f64 * 3125.0,
                kind: [Kind::Strongest, Kind::Second][which],
            };
            assert_eq!(found, expected, "{profile}");
        }
    }
}

/// By the manual's "XYZ Lookup Table": r counts from the origin of the lidar frame, so that n, the
/// length of the shift of the beams, goes off it. Of two rows of one altitude, the later is lower.
#[test]
fn beams_begin_beside_and_above_the_origin_and_rows_are_listed_from_above() {
    let mut metadata = flat(Profile::Single);
    metadata["beam_to_lidar_transform"] = json!([1, 0, 0, 30, 0, 1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1]);
    metadata["beam_altitude_angles"] = json!([30, 0, 0]);
    metadata["beam_azimuth_angles"] = json!([0, 0, 0]);
    let mut found = Vec::new();
    let packet = packet_of(Profile::Single, 1, 0, |_, _| [(2050, 1), (0, 0)]);
    Decoder::new(&parse(&metadata).unwrap()).decode(&packet, |it| found.push(*it)).unwrap();
    let [high, middle, low] = found[..3] else { panic!("expected three rows") };
    assert_eq!([high.ring, middle.ring, low.ring], [2, 1, 0]);
    // 2.05 m less 0.05 m; half a turn about z, and up to the sensor's frame.
    for (found, x, z) in [(high, 3f64.sqrt(), 1.0), (low, 2.0, 0.0)] {
        let expected = [-x - 0.03, 0.0, z + 0.04 + HEIGHT_M];
        let apart = [0, 1, 2].map(|axis| f64::from(found.point_m[axis]) - expected[axis]);
        assert!(apart.iter().all(|x| x.abs() < 4.8e-7), "{apart:?}");
    }
}

/// The widths of the field RANGE in Ouster's Software User Manual ("Lidar Data Packet Format"): 20
/// bits in the legacy format, 19 in RNG19, and 15 bits of 8 mm in RNG15.
#[test]
fn the_farthest_range_of_each_profile_is_read_to_its_last_bit() {
    for profile in Profile::ALL {
        let farthest_mm = match profile {
            Profile::Legacy => (1 << 20) - 1,
            Profile::Single | Profile::Dual => (1 << 19) - 1,
            Profile::LowRate => 8 * ((1 << 15) - 1),
        };
        let packet = packet_of(profile, 1, 0, |_, _| [(farthest_mm, 1), (farthest_mm - 8, 2)]);
        let mut found = Vec::new();
        decoder(profile).decode(&packet, |it| found.push(it.range_m)).unwrap();
        let expected = [farthest_mm, farthest_mm - 8].map(|mm| (f64::from(mm) * 1e-3) as f32);
        let returns = if profile == Profile::Dual { 2 } else { 1 };
        assert_eq!(found, expected[..returns].repeat(12), "{profile}");
    }
}

#[test]
fn unmeasured_pixels_give_no_return() {
    let decoder = decoder(Profile::Single);
    let mut bytes = packet(Profile::Single, 1, 4);
    let column = 12 + 3 * 12;
    // The first column is not valid, and the second one's first row saw nothing.
    bytes[32 + 10] = 0xfe;
    bytes[32 + column + 12..][..3].fill(0);
    let (mut n, mut first_us) = (0, f64::NAN);
    let header = decoder.decode(&bytes, |found| {
        first_us = if n == 0 { found.after_us } else { first_us };
        n += 1;
    });
    let header = header.unwrap();
    assert_eq!((n, header.valid, header.measurement_id), (3 * 3 - 1, 0b1110, 4));
    // Times count from the first column that was measured.
    assert_eq!((header.time_ns, first_us), (START_NS + (32 + 5) * COLUMN_NS, 0.0));
    (0..4).for_each(|i| bytes[32 + i * column + 10] = 0);
    let header = decoder.decode(&bytes, |_| panic!("a return of a column that is not valid"));
    assert_eq!(header.unwrap().valid, 0);
}

#[test]
fn other_packets_are_named() {
    let decoder = decoder(Profile::Single);
    let bytes = packet(Profile::Single, 1, 4);
    let said = |bytes: &[u8]| decoder.header(bytes).unwrap_err().to_string();
    assert_eq!(decoder.packet_size(), 256);
    assert_eq!(said(&[0; 48]), "expected a lidar packet of 256 bytes, found 48 bytes");
    let changed = |at: usize, byte: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = byte;
        said(&bytes)
    };
    assert_eq!(changed(0, 2), "expected a packet of type 1 (lidar), found type 2");
    let expected = "column 1: expected measurement 5 of 32, found 6";
    assert_eq!(changed(32 + 48 + 8, 6), expected);
    assert!(
        said(&packet(Profile::Single, 1, 30)).ends_with("expected measurement 32 of 32, found 32")
    );
}

#[test]
fn the_header_of_type_fusa_counts_more_frames() {
    let mut metadata = flat(Profile::Single);
    metadata["data_format"]["header_type"] = json!("FUSA");
    let mut bytes = packet(Profile::Single, 0, 4);
    bytes[4..8].copy_from_slice(&70_000u32.to_le_bytes());
    let header = Decoder::new(&parse(&metadata).unwrap()).header(&bytes);
    assert_eq!(header.unwrap().frame_id, 70_000);
    metadata["data_format"]["header_type"] = json!("STANDARD");
    assert_eq!(parse(&metadata), parse(&flat(Profile::Single)));
}

#[test]
fn the_transform_of_the_lidar_turns_its_azimuths() {
    let mut metadata = flat(Profile::Single);
    for (transform, quarters) in [
        (json!([-1, 0, 0, 0, 0, -1]), 2.0),
        (json!([0, -1, 0, 0, 1, 0]), 1.0),
        (json!([0, 1, 0, 0, -1, 0]), -1.0),
    ] {
        let mut whole = transform.as_array().unwrap().clone();
        whole.extend(json!([0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]).as_array().unwrap().clone());
        metadata["lidar_to_sensor_transform"] = json!(whole);
        let yaw_rad = parse(&metadata).unwrap().yaw_rad();
        assert_eq!(yaw_rad, quarters * std::f64::consts::FRAC_PI_2);
        // Azimuths are clockwise: a lidar that is turned by a yaw begins at minus the yaw.
        let (bytes, mut returns) = (packet(Profile::Single, 0, 0), Vec::new());
        let mut packets = formats::packets::Decoder::new(Some(&parse(&metadata).unwrap()), &bytes);
        let facts = packets.as_mut().unwrap().decode(&bytes, &mut returns).unwrap();
        let off =
            (facts.azimuth_rad.cos() - yaw_rad.cos(), facts.azimuth_rad.sin() + yaw_rad.sin());
        assert!(off.0.abs() < 1e-12 && off.1.abs() < 1e-12, "{facts:?}");
    }
}

#[test]
fn elevations_rise_by_ring() {
    let degrees = |elevations: Vec<f32>| -> Vec<f32> {
        elevations.iter().map(|x| (x.to_degrees() * 1e3).round() / 1e3).collect()
    };
    assert_eq!(degrees(decoder(Profile::Dual).elevations_rad()), [-20.0, 0.5, 15.0]);
    let vlp16 = velodyne::Decoder::new(velodyne::Model::Vlp16).elevations_rad();
    let odd: Vec<_> = (0..16u8).map(|ring| 2.0 * f32::from(ring) - 15.0).collect();
    assert_eq!(degrees(vlp16), odd);
}

#[test]
fn both_layouts_of_metadata_say_the_same() {
    let mut flat = flat(Profile::LowRate);
    let mut nested = json!({
        "lidar_data_format": flat["data_format"],
        "config_params": { "lidar_mode": flat["lidar_mode"] },
        "lidar_intrinsics": { "lidar_to_sensor_transform": flat["lidar_to_sensor_transform"] },
        "beam_intrinsics": flat,
        "sensor_info": { "prod_line": "OS-1-128" },
    });
    assert_eq!(parse(&nested), parse(&flat));
    // The transform of newer firmware tells the beams' height, too.
    let shift = |z: f64| json!([1, 0, 0, 15.8, 0, 1, 0, 0, 0, 0, 1, z, 0, 0, 0, 1]);
    nested["beam_intrinsics"]["beam_to_lidar_transform"] = shift(0.0);
    assert_eq!(parse(&nested), parse(&flat));
    nested["beam_intrinsics"]["beam_to_lidar_transform"] = shift(2.0);
    assert_ne!(parse(&nested), parse(&flat));
    // What firmware does not name is what it was when there was nothing else.
    let legacy =
        json!({ "columns_per_frame": 32, "columns_per_packet": 4, "pixels_per_column": 3 });
    flat["data_format"] = legacy;
    assert_eq!(parse(&flat), parse(&self::flat(Profile::Legacy)));
}

/// By `default_data_format` and its neighbours in ouster-sdk's `types.cpp`.
#[test]
fn the_oldest_metadata_are_completed_as_by_ouster_sdk() {
    let mut old = flat(Profile::Legacy);
    old["lidar_mode"] = json!("512x20");
    let mut stated = old.clone();
    stated["data_format"] =
        json!({ "columns_per_frame": 512, "columns_per_packet": 16, "pixels_per_column": 3 });
    let object = old.as_object_mut().unwrap();
    object.remove("data_format");
    assert_eq!(parse(&old), parse(&stated));
    assert_eq!(parse(&stated).unwrap().origin_m, [ORIGIN_M, 0.0]);
    let object = old.as_object_mut().unwrap();
    object.remove("lidar_to_sensor_transform");
    object.remove("lidar_origin_to_beam_origin_mm");
    for (line, millimetres) in
        [("OS-0-32", 27.67), ("OS-1-64", 15.806), ("OS-2-128", 13.762), ("other", 12.163)]
    {
        old["prod_line"] = json!(line);
        stated["lidar_origin_to_beam_origin_mm"] = json!(millimetres);
        stated["lidar_to_sensor_transform"] =
            json!([-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]);
        assert_eq!(parse(&old), parse(&stated), "{line}");
    }
    old["lidar_mode"] = json!("turbo");
    let error = parse(&old).unwrap_err();
    assert_eq!(error, "m.json: lidar_mode: expected a mode such as 1024x10, found \"turbo\"");

    let path = need!(shared_data("bug_inputs/flat_nofmt.json"));
    let metadata = Metadata::read(&path).unwrap();
    assert_eq!((metadata.columns_per_frame, metadata.columns_per_packet), (1024, 16));
    // Firmware 1.13: 16 columns of 64 pixels of 12 bytes, with 20 bytes around each column.
    let decoder = Decoder::new(&metadata);
    assert_eq!((decoder.packet_size(), decoder.columns()), (12_608, 16));
}

#[test]
fn beams_do_not_depend_on_the_profile_of_packets() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.json");
    let mut metadata = flat(Profile::Single);
    for (profile, unit_m) in
        [("RNG19_RFL8_SIG16_NIR16_ZONE16", 0.001), ("FUSA_RNG15_RFL8_NIR8_DUAL", 0.008)]
    {
        metadata["data_format"]["udp_profile_lidar"] = json!(profile);
        fs::write(&path, format!("\u{feff}{metadata}")).unwrap();
        let beams = Metadata::read_beams(&path).unwrap();
        assert_eq!(beams.beams_deg, ROWS_DEG);
        assert_eq!(beams.range_unit_m(), unit_m);
        let error = Metadata::read(&path).unwrap_err().to_string();
        assert!(error.contains(&format!("unknown lidar profile `{profile}`")), "{error}");
    }
}

#[test]
fn metadata_that_make_no_sense_are_named() {
    let said = |pointer: &str, value: Value| {
        let mut metadata = flat(Profile::Single);
        *metadata.pointer_mut(pointer).unwrap() = value;
        parse(&metadata).unwrap_err()
    };
    for (pointer, value, expected) in [
        (
            "data_format/columns_per_frame",
            json!(1 << 20),
            "expected a whole number, 1 to 4096, found 1048576",
        ),
        ("data_format/columns_per_packet", json!(65), "expected a whole number, 1 to 64, found 65"),
        (
            "data_format/udp_profile_lidar",
            json!("RNG1"),
            "unknown lidar profile `RNG1`, expected one of LEGACY,",
        ),
        ("data_format/udp_profile_lidar", json!(1), "expected a name, found 1"),
        ("data_format/column_window", json!([0, 32]), "expected a whole number, 0 to 31, found 32"),
        ("lidar_mode", json!("1024x10"), "expected a mode such as 32x10, found \"1024x10\""),
        ("beam_azimuth_angles", json!([0, "x", 0]), "expected a number, -360 to 360, found \"x\""),
        ("lidar_origin_to_beam_origin_mm", json!(1e9), "expected a number, -10000"),
        (
            "lidar_to_sensor_transform",
            json!(vec![0; 16]),
            "expected a rotation and a translation, found [0,0",
        ),
    ] {
        let expected = format!("m.json: {}: {expected}", pointer.replace('/', "."));
        let found = said(&format!("/{pointer}"), value);
        assert!(found.starts_with(&expected), "{found}");
    }
    let pixels = said("/data_format/pixels_per_column", json!(2));
    assert_eq!(pixels, "m.json: beam_altitude_angles: expected 2 values, found 3");
    let none = said("/data_format", json!("error"));
    assert_eq!(none, "m.json: data_format.columns_per_frame: expected a value, found none");
    let error = Metadata::parse("{", Path::new("m.json")).unwrap_err().to_string();
    assert!(error.starts_with("m.json: metadata: expected JSON: EOF"), "{error}");
    let error = Metadata::parse(&" ".repeat(5 << 20), Path::new("m.json")).unwrap_err().to_string();
    assert_eq!(error, "m.json: metadata: expected at most 4194304 bytes, found more");
}

/// An Ethernet frame of each part of a UDP packet, of `at_once` bytes at most (RFC 791).
fn frames(payload: &[u8], identification: u8, at_once: usize) -> Vec<Vec<u8>> {
    let length = (8 + payload.len() as u16).to_be_bytes();
    let udp = [&[0x1d, 0x4e, 0x1d, 0x4e], &length[..], &[0, 0], payload].concat();
    let frame = |(i, part): (usize, &[u8])| {
        let more = (i + 1) * at_once < udp.len();
        let offset = ((i * at_once / 8) as u16 | u16::from(more) << 13).to_be_bytes();
        let length = (20 + part.len() as u16).to_be_bytes();
        let ip =
            [&[0x45, 0], &length[..], &[0, identification], &offset, &[64, 17, 0, 0], &[10; 8]];
        [&[0; 12][..], &[8, 0], &ip.concat(), part].concat()
    };
    udp.chunks(at_once).enumerate().map(frame).collect()
}

/// What a sensor sends from the middle of a frame on: an IMU's packet after each of the lidar's.
fn capture(at_once: usize) -> Vec<Vec<u8>> {
    let (mut sent, mut identification) = (Vec::new(), 0);
    for column in (16..96).step_by(4) {
        let lidar = packet(Profile::Dual, column / COLUMNS, column % COLUMNS);
        for payload in [&lidar[..], &[0; 48]] {
            sent.extend(frames(payload, identification, at_once));
            identification += 1;
        }
    }
    sent
}

#[test]
fn the_first_whole_frame_of_a_capture_is_read_also_from_fragments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.pcapng");
    let metadata = parse(&flat(Profile::Dual)).unwrap();
    let read = |frames: &[Vec<u8>]| {
        fs::write(&path, pcapng(frames)).unwrap();
        read_frame(&path, &metadata, &mut Senders::default())
            .map(|(scan, _)| scan)
            .map_err(|error| error.to_string())
    };
    let scan = read(&capture(1480)).unwrap();
    assert_eq!(scan.len(), 32 * 3 * 2);
    let (rings, times) = (scan.ring.as_ref().unwrap(), scan.time_s.as_ref().unwrap());
    assert_eq!(rings[..6], [0, 0, 2, 2, 1, 1]);
    assert!((times[191] - 31.0 * 3125e-6).abs() < 1e-7, "{}", times[191]);
    let range = f64::from(measured(0, 0)[0].0) * 1e-3;
    let apart = [0, 1, 2].map(|axis| f64::from(scan.positions[0][axis]) - point(0, 0, range)[axis]);
    assert!(apart.iter().all(|x| x.abs() < 4.8e-7), "{apart:?}");

    let fragments = capture(160);
    assert_eq!(read(&fragments).unwrap(), scan);
    let mut shuffled = fragments.clone();
    shuffled.chunks_mut(3).for_each(|some| some.reverse());
    assert_eq!(read(&shuffled).unwrap(), scan);
    // A packet that came twice is taken once.
    let twice: Vec<_> =
        capture(1480).into_iter().flat_map(|frame| [frame.clone(), frame]).collect();
    assert_eq!(read(&twice).unwrap(), scan);
}

#[test]
fn a_capture_without_a_whole_frame_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.pcapng");
    let read = |frames: &[Vec<u8>], metadata: &Value| {
        fs::write(&path, pcapng(frames)).unwrap();
        let scan = read_frame(&path, &parse(metadata).unwrap(), &mut Senders::default())
            .map(|(scan, _)| scan);
        scan.map_err(|error| error.to_string().split_once("pcapng: ").unwrap().1.to_owned())
    };
    let mut metadata = flat(Profile::Dual);
    // The second frame without its fourth packet, and the third without its last.
    let mut lost = capture(1480);
    lost.pop();
    lost.pop();
    lost.remove(2 * 7);
    let expected =
        "packets: expected a whole frame of 32 columns, found 28 at most among 37 UDP packets";
    assert_eq!(read(&lost, &metadata).unwrap_err(), expected);
    // Whole is what the sensor is told to send.
    metadata["data_format"]["column_window"] = json!([18, 10]);
    assert_eq!(read(&lost, &metadata).unwrap().len(), 28 * 3 * 2);

    // Of the packet of columns 16 to 19, only the last is to be sent; it is lost.
    metadata["data_format"]["column_window"] = json!([19, 10]);
    let mut lost = capture(1480);
    lost.drain(..8);
    lost.drain(16..);
    lost.drain(8..10);
    let expected =
        "packets: expected a whole frame of 24 columns, found 23 at most among 14 UDP packets";
    assert_eq!(read(&lost, &metadata).unwrap_err(), expected);

    metadata["data_format"]["column_window"] = json!([18, 10]);
    let mut fragments = capture(160);
    fragments.truncate(3);
    fragments.remove(1);
    let expected = "packets: expected a whole frame of 25 columns, found 0 at most among \
                    1 UDP packet, beside 1 without all fragments";
    assert_eq!(read(&fragments, &metadata).unwrap_err(), expected);
}

#[test]
fn columns_outside_of_the_window_are_not_missing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("window.pcap");
    let mut metadata = flat(Profile::Dual);
    metadata["data_format"]["column_window"] = json!([4, 15]);
    let metadata = parse(&metadata).unwrap();
    let sent: Vec<_> = (0..3).flat_map(|frame| [4, 8, 12].map(|at| (frame, at))).collect();
    for (lost, missing) in [(None, 0), (Some(4), 1)] {
        let kept = sent.iter().enumerate().filter(|(i, _)| Some(*i) != lost);
        let packets: Vec<_> = kept
            .flat_map(|(_, &(frame, at))| frames(&packet(Profile::Dual, frame, at), at as u8, 1480))
            .collect();
        fs::write(&file, pcapng(&packets)).unwrap();
        let read = read_turns(&file, Some(&metadata), &mut Senders::default(), |_| {
            std::ops::ControlFlow::Continue(())
        });
        assert_eq!(read.unwrap().1.missing, missing, "{lost:?}");
    }
}

/// Turns are those of the returns' own azimuths, over frames and a gap of two turns and two packets.
#[test]
fn all_turns_of_a_capture_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("turns.pcap");
    let metadata = parse(&flat(Profile::Dual)).unwrap();
    let packets = (0..5).flat_map(|frame| (0..COLUMNS).step_by(4).map(move |at| (frame, at)));
    let kept = packets.filter(|(frame, at)| !(40..112).contains(&(frame * COLUMNS + at)));
    let packets: Vec<_> = kept
        .flat_map(|(frame, at)| frames(&packet(Profile::Dual, frame, at), at as u8, 1480))
        .collect();
    fs::write(&file, pcapng(&packets)).unwrap();
    let mut found = Vec::new();
    let read = read_turns(&file, Some(&metadata), &mut Senders::default(), |turned| {
        found.push(*turned);
        std::ops::ControlFlow::Continue(())
    });
    let (model, counts) = read.unwrap();
    assert_eq!((model, counts.missing), (None, 72 / 4));
    // One of two returns of each row.
    assert_eq!(found.len(), (5 * usize::from(COLUMNS) - 72) * 3);
    for turned in &found {
        let [x, y, _] = turned.found.point_m.map(f64::from);
        let azimuth = -y.atan2(x) / std::f64::consts::TAU;
        assert!(((turned.turns - azimuth).rem_euclid(1.0) + 0.5).fract() - 0.5 < 1e-9);
        // Ten turns a second, from a packet that starts behind.
        let off = turned.turns - found[0].turns - 10.0 * turned.time_s;
        assert!(off.abs() < 0.02, "{turned:?}: {off}");
    }
    let gaps = found.iter().map(|turned| turned.gaps).max();
    assert_eq!((gaps, found[0].gaps), (Some(1), 0));
    let error = read_turns(&file, None, &mut Senders::default(), |_| unreachable!()).unwrap_err();
    assert!(
        error.to_string().contains("or --metadata for an Ouster's, found none among"),
        "{error}"
    );
}
