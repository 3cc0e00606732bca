use std::fs;
use std::path::Path;

use formats::Attribute;
use formats::hash::Hashing;
use formats::scan::{ColumnSlot, Scan};
use formats::scan_file::{ScanFormat, read_scan, write_scan};
use proptest::prelude::*;

use crate::numpy::{npy, npz};
use crate::written_bytes;

/// A scan of `n` points with the attributes whose bits are set in `wanted`.
fn scan(n: usize, wanted: u16) -> Scan {
    let mut scan = written_bytes::scan(n, [0.0; 3]);
    for attribute in Attribute::ALL.into_iter().filter(|&at| wanted >> at as u8 & 1 == 0) {
        match scan.slot(attribute) {
            ColumnSlot::F32(values) => *values = None,
            ColumnSlot::U8(values) => *values = None,
            ColumnSlot::U16(values) => *values = None,
            ColumnSlot::U32(values) => *values = None,
            ColumnSlot::Vector(values) => *values = None,
        }
    }
    scan
}

fn there_and_back(scan: &Scan, format: ScanFormat) -> Scan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan").with_extension(format.name());
    write_scan(&path, format, Hashing::None, scan).unwrap();
    read_scan(&path).unwrap()
}

/// The bytes by the specification of PCD 0.7: SIZE, TYPE and COUNT of each of FIELDS, and rows in
/// their order, little-endian.
#[test]
fn pcd_has_the_fields_of_a_scan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.pcd");
    let mut scan = Scan {
        positions: vec![[1.0, -2.0, 0.5], [0.25, 3.0, -1.5]],
        ring: Some(vec![7, 300]),
        object: Some(vec![0, 70_000]),
        return_number: Some(vec![0, 1]),
        intensity: Some(vec![0.5, 1.0]),
        normal: Some(vec![[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
        ..Scan::default()
    };
    write_scan(&path, ScanFormat::Pcd, Hashing::None, &scan).unwrap();
    let header = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n\
                  FIELDS x y z ring object intensity return normal_x normal_y normal_z\n\
                  SIZE 4 4 4 2 4 4 1 4 4 4\nTYPE F F F U U F U F F F\n\
                  COUNT 1 1 1 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\n\
                  VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n";
    let mut expected = header.as_bytes().to_vec();
    for (at, ring, object, intensity, number, normal) in [
        ([1f32, -2.0, 0.5], 7u16, 0u32, 0.5f32, 0u8, [0f32, 0.0, 1.0]),
        ([0.25, 3.0, -1.5], 300, 70_000, 1.0, 1, [0.0, -1.0, 0.0]),
    ] {
        expected.extend(at.iter().flat_map(|x| x.to_le_bytes()));
        expected.extend(ring.to_le_bytes());
        expected.extend(object.to_le_bytes());
        expected.extend(intensity.to_le_bytes());
        expected.push(number);
        expected.extend(normal.iter().flat_map(|x| x.to_le_bytes()));
    }
    let found = fs::read(&path).unwrap();
    assert_eq!(found, expected, "{}", String::from_utf8_lossy(&found));
    let wide: Vec<_> = scan.positions.iter().map(|point| point.map(f64::from)).collect();
    assert_eq!(formats::cloud_file::read_cloud(&path).unwrap(), wide);
    // A sensor that looks left from (20, 0, 1.7), one that looks back, and one on its head.
    let half = 0.5f64.sqrt();
    for (rotation, quaternion) in [
        ([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [half, 0.0, 0.0, half]),
        ([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], [0.0, 0.0, 0.0, 1.0]),
        ([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]], [0.0, 1.0, 0.0, 0.0]),
    ] {
        let place = [20.0, 0.0, 1.7];
        let mut pose = [0.0; 16];
        (0..3).for_each(|row| {
            pose[4 * row..4 * row + 3].copy_from_slice(&rotation[row]);
            pose[4 * row + 3] = place[row];
        });
        pose[15] = 1.0;
        scan.pose = Some(pose);
        write_scan(&path, ScanFormat::Pcd, Hashing::None, &scan).unwrap();
        let bytes = fs::read(&path).unwrap();
        let header = String::from_utf8_lossy(&bytes).into_owned();
        let line = header.lines().find_map(|line| line.strip_prefix("VIEWPOINT ")).unwrap();
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-15;
        let expected = [&place[..], &quaternion].concat();
        assert!(numbers.iter().zip(expected).all(|(a, b)| near(*a, b)), "{line}");
        let read = formats::cloud_file::read_cloud_as(&path, None).unwrap().pose.unwrap();
        assert!(read.iter().zip(pose).all(|(a, b)| near(*a, b)), "{read:?}");
    }
    scan.origin = [1e6, 0.0, 0.0];
    let error = write_scan(&path, ScanFormat::Pcd, Hashing::None, &scan).unwrap_err();
    assert!(error.to_string().contains("origin: PCD has no place for the origin"), "{error}");
}

proptest! {
    #[test]
    fn a_scan_comes_back_from_its_file(n in 0usize..40, wanted in any::<u16>()) {
        let scan = scan(n, wanted);
        prop_assert_eq!(&there_and_back(&scan, ScanFormat::Npz), &scan);
        prop_assert_eq!(&there_and_back(&scan, ScanFormat::Ply), &scan);
    }

    #[test]
    fn a_damaged_file_is_an_error_or_a_scan(
        at in any::<prop::sample::Index>(), value in any::<u8>(), cut in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        for format in [ScanFormat::Npz, ScanFormat::Ply] {
            let path = folder.path().join("scan").with_extension(format.name());
            write_scan(&path, format, Hashing::None, &scan(5, 0xffff)).unwrap();
            let mut bytes = fs::read(&path).unwrap();
            let at = at.index(bytes.len());
            if cut { bytes.truncate(at) } else { bytes[at] = value }
            fs::write(&path, &bytes).unwrap();
            if let Ok(read) = read_scan(&path) {
                prop_assert!(read.check_lengths().is_ok());
            }
        }
    }
}

#[test]
fn a_scan_without_points_comes_back_and_a_distant_one_keeps_its_micrometres_and_pose() {
    // A quarter turn about z, then a step.
    let turned = [0., -1., 0., 4., 1., 0., 0., 1e7, 0., 0., 1., 0.1, 0., 0., 0., 1.];
    let object_texts = [vec!["near chair".to_owned(), "b".to_owned()], vec![String::new(); 2]];
    let origin = [1e7, -1e7 + 1e-6, 0.0];
    let far = Scan { origin, pose: Some(turned), object_texts, ..scan(3, 0) };
    assert_eq!(far.sensor_position_m(), [4.0, 1e7, 0.1]);
    for format in [ScanFormat::Npz, ScanFormat::Ply] {
        assert_eq!(there_and_back(&scan(0, 0xffff), format), scan(0, 0xffff), "{format}");
        assert_eq!(there_and_back(&far, format), far, "{format}");
    }
}

#[test]
fn csv_has_a_name_and_a_number_for_each_column() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.csv");
    let scan = Scan {
        origin: [1e7, 0.0, 0.0],
        positions: vec![[0.5, 0.1, -0.0]],
        ring: Some(vec![31]),
        normal: Some(vec![[0.0, 1.0, 0.25]]),
        ..Scan::default()
    };
    write_scan(&path, ScanFormat::Csv, Hashing::None, &scan).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text, "x,y,z,ring,nx,ny,nz\n10000000.5,0.1,-0,31,0,1,0.25\n");
    write_scan(&path, ScanFormat::Csv, Hashing::None, &Scan::default()).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "x,y,z\n");
}

#[test]
fn an_attribute_of_another_length_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.npz");
    let scan = Scan { ring: Some(vec![1]), ..scan(2, 0) };
    for format in ScanFormat::POINTS {
        let error = write_scan(&path, format, Hashing::None, &scan).unwrap_err();
        assert_eq!(
            error.to_string(),
            "attribute ring: expected 2 values, one for each point, found 1"
        );
        assert!(!path.exists());
    }
}

fn error_of(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let error = read_scan(&path).unwrap_err().to_string();
    let (file, cause) = error.split_once(name).unwrap();
    assert_eq!(Path::new(file), folder.path().join(""));
    cause.to_owned()
}

#[test]
fn errors_name_the_file_and_the_part() {
    assert!(error_of("a.npz", b"no archive").starts_with(": archive: "));
    assert!(error_of("a.npz", b"").starts_with(": archive: "));
    assert!(error_of("a.xyz", b"").starts_with(": extension: unknown scan format `xyz`"));
    assert!(error_of("a.ply", b"ply\n").starts_with(": header: "));
    let axes = "property float x\nproperty float y\nproperty float z\n";
    let header = format!("ply\nformat ascii 1.0\nelement vertex 1000000000\n{axes}end_header\n");
    assert_eq!(
        error_of("a.ply", header.as_bytes()),
        ": line 8: the file ends after 0 of 1000000000"
    );
    let short = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n";
    assert_eq!(error_of("a.ply", short.as_bytes()), ": element vertex: property y is missing");
    let empty = "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nend_header\n";
    assert_eq!(error_of("a.ply", empty.as_bytes()), ": element vertex: property x is missing");
    let ring = |property: &str, value: &str| {
        let header = format!("ply\nformat ascii 1.0\nelement vertex 1\n{axes}{property}\n");
        error_of("a.ply", format!("{header}end_header\n0 0 0 {value}\n").as_bytes())
    };
    let expected = ": property ring: expected a whole number of 16 bits, found ";
    assert_eq!(ring("property int ring", "65536"), format!("{expected}65536"));
    assert_eq!(ring("property float ring", "0.5"), format!("{expected}0.5"));
    let list = ": element vertex: expected a number as property ring, found a list";
    assert_eq!(ring("property list uchar int ring", "1 7"), list);
}

/// Numbers of any type that holds their values, and columns of the points' length.
#[test]
fn columns_of_archives_may_be_of_other_types() {
    let with = |key, descr, shape, data: &[u8]| {
        let positions = [0.1f64; 6].map(f64::to_le_bytes).concat();
        let positions = npy("<f8", "False", "(2, 3)", &positions);
        npz(&[("positions", positions), (key, npy(descr, "False", shape, data))])
    };
    let read = |bytes: &[u8]| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        fs::write(&path, bytes).unwrap();
        read_scan(&path).unwrap()
    };
    let rings = [7i64, 65535].map(i64::to_le_bytes).concat();
    let scan = read(&with("ring", "<i8", "(2,)", &rings));
    assert_eq!((scan.positions[1], scan.ring), ([0.1; 3], Some(vec![7, 65535])));
    let times = [0.5f64, 0.1].map(f64::to_be_bytes).concat();
    assert_eq!(read(&with("time", ">f8", "(2, 1)", &times)).time_s, Some(vec![0.5, 0.1]));
    let returns = [1f32, 2.0].map(f32::to_le_bytes).concat();
    assert_eq!(read(&with("return", "<f4", "(2,)", &returns)).return_number, Some(vec![1, 2]));
    assert_eq!(read(&with("intensity", "|u1", "(2,)", &[0, 9])).intensity, Some(vec![0.0, 9.0]));
    for (key, descr, shape, data, cause) in [
        ("ring", "<i8", "(2,)", &[255; 16][..], "expected a whole number of 16 bits, found -1"),
        ("ring", "<f4", "(2,)", &[63; 8], "expected a whole number of 16 bits, found 0.74"),
        ("ring", "|u1", "(3,)", &[1; 3], "expected 2 values, one for each point, found 3"),
        ("beam", "|u1", "(2, 2)", &[1; 4], "expected shape [2, 1], found [2, 2]"),
        ("normal", "<f4", "(2,)", &[0; 8], "expected shape [2, 3], found [2]"),
        (
            "time",
            "<i8",
            "(2,)",
            &[0; 16],
            "expected seconds or metres of a floating type, found <i8",
        ),
        ("intensity", "<U1", "(2,)", &[0; 8], "expected numbers, found elements of type `<U1`"),
    ] {
        let error = error_of("a.npz", &with(key, descr, shape, data));
        assert!(error.starts_with(&format!(": {key}: {cause}")), "{error}");
    }
}

#[test]
fn points_that_are_far_get_an_origin_near_them() {
    let near = Scan::of_points(&[[f64::NAN; 3], [8000.5, -1.0, f64::INFINITY]]);
    assert_eq!((near.origin, near.positions[1]), ([0.0; 3], [8000.5, -1.0, f32::INFINITY]));
    let utm = [691_000.125, 5_334_000.25, 500.0];
    let far = Scan::of_points(&[[f64::NAN; 3], utm, utm.map(|x| x + 0.25)]);
    assert_eq!(far.origin, [691_000.0, 5_334_000.0, 500.0]);
    assert_eq!(far.positions[1..], [[0.125, 0.25, 0.0], [0.375, 0.5, 0.25]]);
    assert!(far.positions[0].iter().all(|x| x.is_nan()));
}
