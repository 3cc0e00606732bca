use super::{MANY, error, read};
use formats::cloud_file::{CloudFormat, read_cloud, read_cloud_from};
use std::path::Path;
use test_support::{need, shared_data};

const HEADER: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n";

fn pcd(header: &str, data: &[u8]) -> Vec<u8> {
    [HEADER.as_bytes(), header.as_bytes(), data].concat()
}

#[test]
fn text_is_read_by_its_columns() {
    let header = "FIELDS normal intensity x y z\nSIZE 4 4 4 8 4\nTYPE F U F F F\n\
                  COUNT 3 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n\
                  DATA ascii\n";
    let data = b"0 0 1 7 1.5 0.1 -3\n\n0 0 1 7 nan 1e400 6\n";
    let points = read("a.pcd", pcd(header, data));
    assert_eq!(points[0], [1.5, 0.1, -3.0]);
    assert!(points[1][0].is_nan());
    assert_eq!(points[1][1..], [f64::INFINITY, 6.0]);
}

/// x y z and w x y z: a quaternion of any length is a quarter about z.
#[test]
fn a_viewpoint_is_the_pose_of_the_sensor() {
    let header =
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nVIEWPOINT 1 2 3 2 0 0 2\nPOINTS 1\nDATA ascii\n";
    let (name, bytes) = (Path::new("a.pcd"), pcd(header, b"0 0 0\n"));
    let cloud = read_cloud_from(&bytes[..], Some(CloudFormat::Pcd), name).unwrap();
    let expected =
        [0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0];
    assert_eq!(cloud.pose, Some(expected));
    // Without a rotation, as PCL reads a quaternion of zeros.
    let bytes = pcd(&header.replace("2 0 0 2", "0 0 0 0"), b"0 0 0\n");
    let cloud = read_cloud_from(&bytes[..], Some(CloudFormat::Pcd), name).unwrap();
    let expected = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0];
    assert_eq!(cloud.pose, Some(expected));
}

#[test]
fn binary_points_are_read_whatever_lies_between() {
    let header = "FIELDS _ z label y x\nSIZE 1 8 2 2 4\nTYPE U F U I F\nCOUNT 3 1 1 1 1\n\
                  WIDTH 1\nHEIGHT 2\nDATA binary\n";
    let point = |z: f64, y: i16, x: f32| {
        [&[9; 3], &z.to_le_bytes()[..], &[9; 2], &y.to_le_bytes(), &x.to_le_bytes()].concat()
    };
    let data = [point(1e-300, -2, 0.5), point(4.0, 5, 6.0)].concat();
    assert_eq!(read("a.pcd", pcd(header, &data)), [[0.5, -2.0, 1e-300], [6.0, 5.0, 4.0]]);
}

#[test]
fn older_headers_and_padding_are_read_as_the_point_cloud_library_does() {
    let data = [1.0f32, 2.0, 3.0].map(f32::to_le_bytes).concat();
    let old = "COLUMNS x y z\nPOINTS 1\nDATA binary\n";
    assert_eq!(
        read(
            "a.pcd",
            ["# .PCD v.5\n", old]
                .concat()
                .into_bytes()
                .into_iter()
                .chain(data.clone())
                .collect::<Vec<_>>()
        ),
        [[1.0, 2.0, 3.0]]
    );
    let marked = [b"\xef\xbb\xbf", HEADER.as_bytes(), old.as_bytes(), &data].concat();
    assert_eq!(read("a.pcd", marked), [[1.0, 2.0, 3.0]]);
    let padded = "FIELDS x _ y _ z\nSIZE 4 1 4 1 4\nTYPE F U F U F\nCOUNT 1 0 1 2 1\nPOINTS 1\n";
    let point = [&data[..8], &[9; 2], &data[8..]].concat();
    assert_eq!(read("a.pcd", pcd(&format!("{padded}DATA binary\n"), &point)), [[1.0, 2.0, 3.0]]);
    let ascii = pcd(&format!("{padded}DATA ascii\n"), b"1 2 9 9 3\n");
    assert_eq!(read("a.pcd", ascii), [[1.0, 2.0, 3.0]]);
    // Compressed padding is dropped, or kept by other programs.
    for numbers in [&data, &point] {
        let size = numbers.len() as u32;
        let sizes = [size + 1, size].map(u32::to_le_bytes).concat();
        let literals = [&sizes[..], &[size as u8 - 1], numbers].concat();
        let file = pcd(&format!("{padded}DATA binary_compressed\n"), &literals);
        assert_eq!(read("a.pcd", file), [[1.0, 2.0, 3.0]]);
    }
    let no_x = pcd("FIELDS x y z\nCOUNT 0 1 1\nPOINTS 1\nDATA ascii\n", b"1 2\n");
    assert_eq!(error("a.pcd", no_x), "FIELDS: expected one number as x, found 0 of type F4");
    let path = need!(shared_data("bug_inputs/padding_count0.pcd"));
    let points = read_cloud(&path).unwrap();
    assert_eq!(points.len(), 200);
    // Its fields after `z` are constant, and its coordinates within a room.
    assert!(points.iter().flatten().all(|x| x.abs() < 100.0), "{points:?}");
}

fn compressed(n: &str, compressed: &[u8], uncompressed: u32) -> Vec<u8> {
    let header = format!(
        "FIELDS x y rgb z\nSIZE 1 1 2 2\nTYPE U I U U\nCOUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\n\
         POINTS {n}\nDATA binary_compressed\n"
    );
    let sizes = [compressed.len() as u32, uncompressed].map(u32::to_le_bytes);
    pcd(&header, &[sizes.as_flattened(), compressed].concat())
}

/// Two points, field after field, as one run of 12 literal bytes.
const FIELDS: [u8; 13] = [11, 1, 4, 0xfe, 5, 9, 9, 9, 9, 3, 0, 6, 1];

#[test]
fn compressed_points_lie_field_after_field() {
    let points = read("a.pcd", compressed("2", &FIELDS, 12));
    assert_eq!(points, [[1.0, -2.0, 3.0], [4.0, 5.0, 262.0]]);
    assert!(read("a.pcd", compressed("0", &[], 0)).is_empty());
}

#[test]
fn binary_points_of_another_number_are_refused() {
    let binary = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA binary\n";
    let refuse = |n: usize| error("a.pcd", pcd(binary, &vec![0; n]));
    assert_eq!(refuse(23), "points: the file ends after 1 of 2");
    assert_eq!(refuse(48), "points: expected 2 by the header, found 4");
    assert_eq!(read("a.pcd", pcd(binary, &[0; 35])).len(), 2);
}

#[test]
fn compressed_points_that_lie_are_refused() {
    let refuse = |bytes: Vec<u8>| error("a.pcd", bytes);
    assert_eq!(
        refuse(compressed("2", &FIELDS, 11)),
        "points: expected 2 points of 6 bytes, found 11 bytes in all"
    );
    assert_eq!(
        refuse(compressed("715827882", &FIELDS, 4_294_967_292)),
        "points: the LZF data end too early"
    );
    assert_eq!(
        refuse(compressed(MANY, &FIELDS, 12)),
        format!("points: expected {MANY} points of 6 bytes, found 12 bytes in all")
    );
    let mut cut = compressed("2", &FIELDS, 12);
    cut.truncate(cut.len() - 1);
    assert_eq!(refuse(cut), "points: the file ends after 12 of 13");
}

#[test]
fn a_promise_beyond_all_memory_is_an_error() {
    let xyz = format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS {MANY}\nDATA ");
    let binary = error("a.pcd", pcd(&format!("{xyz}binary\n"), &[0; 36]));
    assert_eq!(binary, format!("points: the file ends after 3 of {MANY}"));
    let ascii = error("a.pcd", pcd(&format!("{xyz}ascii\n"), b"1 2 3\n"));
    assert_eq!(ascii, format!("line 9: the file ends after 1 of {MANY}"));
    let wide = format!(
        "FIELDS a x y z\nSIZE {MANY} 4 4 4\nTYPE F F F F\nCOUNT {MANY} 1 1 1\nPOINTS 1\nDATA binary\n"
    );
    assert!(
        error("a.pcd", pcd(&wide, &[0; 36]))
            .starts_with("points: expected points of 1 to 16777216 bytes, found 1844674407370955")
    );
}
