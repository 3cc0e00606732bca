use std::fs;
use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud, read_cloud_as};
use test_support::{need, shared_data};

use super::{error, read};

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

#[test]
fn the_name_says_how_many_columns_there_are() {
    let numbers: Vec<_> = (0..60).map(|i| i as f32).collect();
    let bytes = floats(&numbers);
    assert_eq!(read("000000.bin", &bytes)[..2], [[0.0, 1.0, 2.0], [4.0, 5.0, 6.0]]);
    assert_eq!(read("frame.f32x5.bin", &bytes)[1], [5.0, 6.0, 7.0]);
    assert_eq!(read("LIDAR_TOP.pcd.bin", &bytes).len(), 12);
    assert_eq!(read("a.f32x3.bin", &bytes)[19], [57.0, 58.0, 59.0]);
    assert!(read("000000.bin", []).is_empty());
}

#[test]
fn points_that_are_not_finite_are_passed_on() {
    let points = read("a.bin", floats(&[f32::NAN, f32::INFINITY, 1e-45, 0.0]));
    assert!(points[0][0].is_nan());
    assert_eq!(points[0][1..], [f64::INFINITY, f64::from(1e-45f32)]);
}

#[test]
fn bin_files_must_hold_plausible_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.bin");
    let read = |format: Option<CloudFormat>, points: &[&[f32]]| {
        fs::write(&path, floats(&points.concat())).unwrap();
        let read = read_cloud_as(&path, format).map(|cloud| cloud.points.len());
        read.map_err(|error| error.to_string().split_once("frame.bin: ").unwrap().1.to_owned())
    };
    let remedy = "name the format by --input-format: kitti has four f32 for each point, nuscenes five; \
                  a file called NAME.f32x6.bin has six";
    let five: Vec<_> = (0..100u8)
        .map(|i| (0.37 * f32::from(i), f32::from(i % 32)))
        .map(|(x, ring)| [x, -x, 0.1 + x, 7.0, ring])
        .collect();
    let five: Vec<_> = five.iter().map(|point| &point[..]).collect();
    let four: Vec<_> = five.iter().map(|point| &point[..4]).collect();
    let rings = format!("format: the fifth numbers look like rings of nuScenes: {remedy}");
    assert_eq!(read(None, &five), Err(rings.clone()));
    assert_eq!(read(Some(CloudFormat::Nuscenes), &five), Ok(100));
    assert_eq!(read(Some(CloudFormat::Kitti), &five), Err(rings.clone()));
    let timed: Vec<_> = (0..100u8).map(|i| [1.0, 2.0, 0.5, 0.25, 0.01 * f32::from(i)]).collect();
    let timed: Vec<_> = timed.iter().map(|point| &point[..]).collect();
    let times = format!("format: the fifth numbers are not whole, as rings are: {remedy}");
    assert_eq!(read(Some(CloudFormat::Nuscenes), &timed), Err(times));
    assert_eq!(read(Some(CloudFormat::Kitti), &timed), Ok(125));
    assert_eq!(read(None, &four), Ok(100));
    let three: Vec<_> = five.iter().map(|point| &point[..3]).collect();
    let negative = "format: the fourth numbers are negative, as intensities are not";
    assert_eq!(read(None, &three), Err(format!("{negative}: {remedy}")));
    let lost = [f32::NAN, f32::NAN, f32::NAN, 0.0];
    assert_eq!(read(None, &[&[1.0, 2.0, 3.0, 0.0], &lost]), Ok(2));
    let finite = "expected three finite numbers, or none for a lost return, found";
    let millimetres = format!(": are they in millimetres? Scale them, or {remedy}");
    for (wrong, cause) in [
        ([1.0, f32::NAN, 3.0, 0.0], format!("{finite} [1.0, NaN, 3.0]: remove the point")),
        (
            [1.0, f32::NEG_INFINITY, 3.0, 0.0],
            format!("{finite} [1.0, -inf, 3.0]: remove the point"),
        ),
        (
            [0.0, 1e5, 0.0, 0.0],
            format!("expected metres from the sensor, found [0.0, 100000.0, 0.0]{millimetres}"),
        ),
    ] {
        assert_eq!(read(None, &[&lost, &wrong]), Err(format!("point 1: {cause}")));
        assert_eq!(read(Some(CloudFormat::Kitti), &[&lost, &wrong]), Ok(2));
    }
    let folder = folder.path().display().to_string();
    let error = read_cloud(Path::new(&folder)).unwrap_err().to_string();
    assert_eq!(
        error,
        format!("{folder}: name: expected a file, found a folder: name the files in it")
    );
    let path = need!(shared_data("bug_inputs/nus100.bin"));
    let error = read_cloud(&path).unwrap_err().to_string();
    assert!(error.ends_with(&rings), "{error}");
    assert_eq!(read_cloud_as(&path, Some(CloudFormat::Nuscenes)).unwrap().points.len(), 100);
}

#[test]
fn an_unfinished_point_is_refused() {
    let bytes = floats(&[1.0; 13]);
    assert_eq!(error("a.bin", &bytes), "point 3: expected 16 bytes, 4 f32, found 4");
    assert_eq!(error("a.f32x5.bin", &bytes[..21]), "point 1: expected 20 bytes, 5 f32, found 1");
}

#[test]
fn packets_of_the_sensor_are_not_taken_for_points() {
    let mut packets = vec![0; 1206 * 8];
    for packet in packets.chunks_mut(1206) {
        packet[..1200].chunks_mut(100).for_each(|block| block[..2].copy_from_slice(&[0xff, 0xee]));
    }
    // 603 times 16 bytes: their size does not tell.
    let message = "format: expected points, found raw Velodyne packets: decode them first";
    assert_eq!(error("a.bin", packets), message);
}
