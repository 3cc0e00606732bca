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
fn what_is_not_finite_is_passed_on() {
    let points = read("a.bin", floats(&[f32::NAN, f32::INFINITY, 1e-45, 0.0]));
    assert!(points[0][0].is_nan());
    assert_eq!(points[0][1..], [f64::INFINITY, f64::from(1e-45f32)]);
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
