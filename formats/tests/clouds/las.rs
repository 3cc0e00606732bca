use std::io::Cursor;

use las::{Builder, Point, Transform, Vector, Version, Writer};

use super::{error, read};

/// Where fields of the header lie (LAS 1.4 R15, table 3).
const OFFSET_TO_POINTS: usize = 96;
const POINT_FORMAT: usize = 104;
const POINT_SIZE: usize = 105;
const N_POINTS: usize = 107;
const SCALES: usize = 131;
const OFFSETS: usize = 155;
const N_EVLRS: usize = 243;
const N_POINTS_1_4: usize = 247;

/// Points with their intensities, as crate `las` writes them in millimetres from `offset`.
pub fn las(
    version: (u8, u8),
    format: u8,
    [x, y, z]: [f64; 3],
    points: &[([f64; 3], u16)],
) -> Vec<u8> {
    let mut builder = Builder::from(version);
    let format = las::point::Format::new(format).unwrap();
    builder.point_format = format;
    let transform = |offset| Transform { scale: 0.001, offset };
    builder.transforms = Vector { x: transform(x), y: transform(y), z: transform(z) };
    let header = builder.into_header().unwrap();
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).unwrap();
    for &([x, y, z], intensity) in points {
        let mut point = Point { x, y, z, intensity, ..Point::default() };
        point.gps_time = format.has_gps_time.then_some(0.0);
        point.color = format.has_color.then(las::Color::default);
        point.nir = format.has_nir.then_some(0);
        writer.write_point(point).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// Three points of UTM.
fn utm(version: (u8, u8), format: u8) -> Vec<u8> {
    let point = |i: u8| ([450_000.123 + f64::from(i), 5_400_000.456, -0.001], 0);
    las(version, format, [4.5e5, 5.4e6, 0.0], &[0, 1, 2].map(point))
}

#[test]
fn every_version_and_format_is_read() {
    for (version, format) in [((1, 0), 0), ((1, 1), 1), ((1, 2), 3), ((1, 4), 6), ((1, 4), 8)] {
        let points = read("a.las", utm(version, format));
        assert_eq!(points.len(), 3, "{version:?}");
        for (i, [x, y, z]) in points.into_iter().enumerate() {
            // The scale and each of the two operations round once: at 5.4e6 a
            // unit in the last place is 9.3e-10.
            assert!((x - (450_000.123 + i as f64)).abs() < 2e-9, "{x}");
            assert!((y - 5_400_000.456).abs() < 2e-9, "{y}");
            assert_eq!(z, -0.001);
        }
    }
    assert_eq!(Version::new(1, 4).header_size(), 375);
}

fn changed(mut bytes: Vec<u8>, at: usize, value: &[u8]) -> Vec<u8> {
    bytes[at..at + value.len()].copy_from_slice(value);
    bytes
}

#[test]
fn malformed_files_are_refused() {
    let whole = || utm((1, 2), 1);
    assert!(error("a.las", "LASF").starts_with("header: "));
    assert!(error("a.las", "no las file at all").starts_with("header: "));
    let compressed = error("a.las", changed(whole(), POINT_FORMAT, &[0x81]));
    assert!(compressed.starts_with("header: LAZ is compressed LAS: decompress"), "{compressed}");
    let short = error("a.las", changed(whole(), POINT_SIZE, &[27, 0]));
    assert_eq!(short, "header: expected points of 28 bytes in format 1, found 27");
    let early = error("a.las", changed(whole(), OFFSET_TO_POINTS, &[100, 0, 0, 0]));
    assert_eq!(early, "header: the points begin before the header ends");
    let late = error("a.las", changed(whole(), OFFSET_TO_POINTS, &[0xff; 4]));
    assert_eq!(late, "header: unexpected end of file");
    let many = error("a.las", changed(whole(), N_POINTS, &[0xff; 4]));
    assert_eq!(many, "points: the file ends after 3 of 4294967295");
}

#[test]
fn scales_and_offsets_that_place_no_point_are_refused() {
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let error = |at: usize, value: f64| {
            error("a.las", changed(utm((1, 2), 1), at + 8 * axis, &value.to_le_bytes()))
        };
        for value in [0.0, f64::NAN, f64::INFINITY] {
            let expected = "expected a finite number other than 0";
            let expected = format!("header: scale of {name}: {expected}, found {value}");
            assert_eq!(error(SCALES, value), expected);
        }
        let expected = format!("header: offset of {name}: expected a finite number, found NaN");
        assert_eq!(error(OFFSETS, f64::NAN), expected);
    }
}

#[test]
fn a_file_that_ends_within_its_header_says_where() {
    for (version, n, size) in [((1, 2), 100, 227), ((1, 4), 300, 375)] {
        let whole = utm(version, 0);
        let expected = format!("header: the file ends after {n} of {size} bytes");
        assert_eq!(error("a.las", &whole[..n]), expected);
    }
}

#[test]
fn a_promise_beyond_all_memory_is_an_error() {
    let legacy_empty = changed(utm((1, 4), 6), N_POINTS, &[0; 4]);
    let many = changed(legacy_empty, N_POINTS_1_4, &[0xff; 8]);
    let message = error("a.las", many);
    assert_eq!(message, format!("points: the file ends after 3 of {}", u64::MAX));
    // Records after the points, which are not needed, may claim what they like.
    let records = changed(utm((1, 4), 6), N_EVLRS, &[0xff; 4]);
    assert_eq!(read("a.las", records).len(), 3);
}
