//! Packets of a VLP-16 and an Ouster in a street of boxes, with returns in closed form.

use std::f64::consts::TAU;

/// Bytes of a data packet.
pub const PACKET: usize = 1206;
/// Firing sequences of a packet, and the time of one.
const SEQUENCES: usize = 24;
const SEQUENCE_S: f64 = 55.296e-6;
pub const PACKET_S: f64 = SEQUENCES as f64 * SEQUENCE_S;
const TURNS_PER_S: f64 = 10.0;
/// Packets of ten turns and a bit.
pub const PACKETS_PER_S: usize = 754;
/// Elevations of the lasers as packets list them, degrees (VLP-16 User Manual 63-9243).
const LASERS_DEG: [f64; 16] =
    [-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0];
/// Height of the sensor above the street, metres.
const HEIGHT_M: f64 = 1.2;
const FARTHEST_M: f64 = 60.0;

/// A moving box on the street, metres and metres per second.
#[derive(Clone, Copy, Debug)]
pub struct Thing {
    pub at: [f64; 2],
    pub velocity: [f64; 2],
    pub size: [f64; 3],
}

impl Thing {
    /// The nearest of a beam's hits on its boxes: a car is a body and a narrower cabin upon it.
    fn distance(&self, beam: [f64; 3], time_s: f64) -> Option<f64> {
        let middle = [0, 1].map(|i| self.at[i] + time_s * self.velocity[i]);
        let [length, width, height] = self.size;
        if length < 2.0 {
            return distance_of_box(middle, self.size, beam);
        }
        let boxes = [[length, width, 0.7 * height], [0.55 * length, 0.85 * width, height]];
        boxes.into_iter().filter_map(|size| distance_of_box(middle, size, beam)).reduce(f64::min)
    }
}

/// Where a beam enters a box that stands on the street.
fn distance_of_box(middle: [f64; 2], size: [f64; 3], beam: [f64; 3]) -> Option<f64> {
    let [length, width, height] = size;
    let low = [middle[0] - length / 2.0, middle[1] - width / 2.0, -HEIGHT_M];
    let high = [middle[0] + length / 2.0, middle[1] + width / 2.0, height - HEIGHT_M];
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let ends = [low[axis] / beam[axis], high[axis] / beam[axis]];
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    (enter <= leave && leave > 0.0).then_some(enter)
}

/// A parked car, a car that drives by and a walking person.
pub fn street() -> Vec<Thing> {
    vec![
        Thing { at: [8.0, -5.0], velocity: [0.0; 2], size: [4.2, 1.8, 1.5] },
        Thing { at: [-10.0, 6.0], velocity: [6.0, 0.0], size: [4.2, 1.8, 1.5] },
        Thing { at: [5.0, 2.0], velocity: [-1.2, 0.4], size: [0.4, 0.5, 1.7] },
    ]
}

/// The first `n` packets of a sensor among `things`, whose stamps begin at `stamp_us`.
pub fn packets(things: &[Thing], stamp_us: u32, n: usize) -> Vec<[u8; PACKET]> {
    (0..n).map(|number| packet(things, stamp_us, number)).collect()
}

fn packet(things: &[Thing], first_stamp_us: u32, number: usize) -> [u8; PACKET] {
    let start_s = number as f64 * PACKET_S;
    let mut bytes = [0; PACKET];
    for block in 0..12 {
        let block_s = start_s + (2 * block) as f64 * SEQUENCE_S;
        let at = &mut bytes[block * 100..][..100];
        let azimuth = ((block_s * TURNS_PER_S * 36_000.0).round() as u64 % 36_000) as u16;
        at[..2].copy_from_slice(&[0xff, 0xee]);
        at[2..4].copy_from_slice(&azimuth.to_le_bytes());
        for i in 0..32 {
            let time_s = block_s + (i / 16) as f64 * SEQUENCE_S + (i % 16) as f64 * 2.304e-6;
            let elevation = LASERS_DEG[i % 16].to_radians();
            let azimuth = time_s * TURNS_PER_S * TAU;
            let units = (distance(things, azimuth, elevation, time_s) / 0.002).round() as u16;
            at[4 + 3 * i..6 + 3 * i].copy_from_slice(&units.to_le_bytes());
            at[6 + 3 * i] = 50;
        }
    }
    // Stamps count from the hour.
    let stamp_us = (u64::from(first_stamp_us) + (start_s * 1e6).round() as u64) % 3_600_000_000;
    let stamp_us = stamp_us as u32;
    bytes[1200..1204].copy_from_slice(&stamp_us.to_le_bytes());
    bytes[1204..].copy_from_slice(&[0x37, 0x22]);
    bytes
}

/// The range of a beam at `time_s`; 0 without a return.
fn distance(things: &[Thing], azimuth: f64, elevation: f64, time_s: f64) -> f64 {
    let (sin, cos) = azimuth.sin_cos();
    let (up, flat) = elevation.sin_cos();
    // Azimuths grow clockwise.
    let beam = [flat * cos, -flat * sin, up];
    let ground = if up < 0.0 { -HEIGHT_M / up } else { f64::INFINITY };
    let hits = things.iter().filter_map(|thing| thing.distance(beam, time_s));
    let nearest = hits.fold(ground, f64::min);
    if nearest <= FARTHEST_M { nearest } else { 0.0 }
}

/// Altitudes and azimuths of an Ouster's rows, degrees.
const ROWS_DEG: [[f64; 2]; 16] = {
    let mut rows = [[0.0; 2]; 16];
    let mut row = 0;
    while row < 16 {
        rows[row] = [15.0 - 2.0 * row as f64, [4.2, 1.4, -1.4, -4.2][row % 4]];
        row += 1;
    }
    rows
};
/// Columns of its turn and of its packet.
const COLUMNS: usize = 1024;
const COLUMNS_PER_PACKET: usize = 16;
pub const OUSTER_PACKETS_PER_S: usize = 640;

/// The metadata of that Ouster, whose lidar faces the sensor's rear.
pub fn ouster_metadata() -> String {
    let column = |i: usize| ROWS_DEG.map(|row| row[i]);
    format!(
        r#"{{"beam_altitude_angles": {:?}, "beam_azimuth_angles": {:?}, "lidar_mode": "1024x10",
        "lidar_origin_to_beam_origin_mm": 15.806,
        "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1],
        "data_format": {{"columns_per_frame": {COLUMNS}, "columns_per_packet": {COLUMNS_PER_PACKET},
        "pixels_per_column": 16, "udp_profile_lidar": "RNG19_RFL8_SIG16_NIR16"}}}}"#,
        column(0),
        column(1)
    )
}

/// Packet number `number` of that Ouster among `things`. The beams begin at the origin; those of
/// the real sensor begin a few centimetres away.
pub fn ouster_packet(things: &[Thing], number: usize) -> Vec<u8> {
    let mut bytes = vec![0; 32];
    let per_turn = COLUMNS / COLUMNS_PER_PACKET;
    bytes[..4].copy_from_slice(&[1, 0, (number / per_turn) as u8, 0]);
    for i in 0..COLUMNS_PER_PACKET {
        let column = number * COLUMNS_PER_PACKET + i;
        let turns = column as f64 / COLUMNS as f64;
        let time_s = turns / TURNS_PER_S;
        bytes.extend(((time_s * 1e9) as u64).to_le_bytes());
        bytes.extend(((column % COLUMNS) as u16).to_le_bytes());
        bytes.extend([1, 0]);
        for [altitude, azimuth] in ROWS_DEG {
            let azimuth = azimuth.to_radians() + (turns + 0.5) * TAU;
            let range_m = distance(things, azimuth, altitude.to_radians(), time_s);
            bytes.extend(((range_m * 1e3).round() as u32).to_le_bytes());
            bytes.extend([60, 0, 0, 0, 0, 0, 0, 0]);
        }
    }
    bytes.extend([0; 32]);
    bytes
}

/// A capture of packets that 192.168.1.201 sent at these microseconds of Unix time.
pub fn capture<'a>(packets: impl IntoIterator<Item = (u64, &'a [u8])>) -> Vec<u8> {
    capture_of(packets.into_iter().map(|(time_us, payload)| (time_us, 201, payload)))
}

/// A capture of packets with the last number of their sender's address, in libpcap's classic format:
/// a header, then before each frame its time and twice its length.
pub fn capture_of<'a>(packets: impl IntoIterator<Item = (u64, u8, &'a [u8])>) -> Vec<u8> {
    let words =
        |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    let mut file = words(&[0xa1b2_c3d4, 2 | 4 << 16, 0, 0, 65_535, 1]);
    for (time_us, sender, payload) in packets {
        let udp_length = payload.len() as u16 + 8;
        let mut frame = vec![0xff; 6];
        frame.extend([0x60, 0x76, 0x88, 0, 0, 0, 8, 0]);
        frame.extend([0x45, 0]);
        frame.extend((udp_length + 20).to_be_bytes());
        frame.extend([0, 0, 0, 0, 64, 17, 0, 0, 192, 168, 1, sender, 255, 255, 255, 255]);
        frame.extend([2368u16, 2368, udp_length, 0].iter().flat_map(|word| word.to_be_bytes()));
        frame.extend(payload);
        let length = frame.len() as u32;
        let time = [(time_us / 1_000_000) as u32, (time_us % 1_000_000) as u32];
        file.extend(words(&[time[0], time[1], length, length]));
        file.extend(frame);
    }
    file
}
