use std::path::Path;

use formats::cloud_file::read_cloud_from;
use zip::write::SimpleFileOptions;

use super::{MANY, error, read};
use crate::numpy::{archive, npy, npz};

fn bytes_of(shape: &str, data: &[u8]) -> Vec<u8> {
    npy("|u1", "False", shape, data)
}

#[cfg(feature = "dataset")]
#[test]
fn a_scan_of_ours_is_read_with_its_origin() {
    use formats::Scan;
    use formats::cloud_file::read_cloud;
    use formats::hash::Hashing;
    use formats::scan_file::{ScanFormat, write_scan};

    let folder = tempfile::tempdir().unwrap();
    let scan = Scan {
        origin: [1e7, -0.25, 0.0],
        positions: vec![[0.5, 0.25, -1.0], [1e-3, 0.0, 3.0]],
        range_m: Some(vec![1.0, 2.0]),
        normal: Some(vec![[0.0, 0.0, 1.0]; 2]),
        ..Scan::default()
    };
    let expected = [[1e7 + 0.5, 0.0, -1.0], [1e7 + f64::from(1e-3f32), -0.25, 3.0]];
    for format in ScanFormat::POINTS {
        let path = folder.path().join("scan").with_extension(format.name());
        write_scan(&path, format, Hashing::None, &scan).unwrap();
        assert_eq!(read_cloud(&path).unwrap(), expected, "{format}");
    }
}

#[test]
fn positions_come_before_points_and_points_before_the_only_array() {
    let [one, two, three] = [1, 2, 3].map(|i| bytes_of("(1, 3)", &[i; 3]));
    let labels = bytes_of("(4,)", &[0; 4]);
    let all = [("x", one.clone()), ("points", two.clone()), ("positions", three)];
    assert_eq!(read("a.npz", npz(&all)), [[3.0; 3]]);
    assert_eq!(read("a.npz", npz(&all[..2])), [[2.0; 3]]);
    assert_eq!(read("a.npz", npz(&[("labels", labels), ("x", one)])), [[1.0; 3]]);
    let wide = npy("|u1", "True", "(1, 5)", &[1, 2, 3, 4, 5]);
    assert_eq!(read("a.npz", npz(&[("arr_0", wide)])), [[1.0, 2.0, 3.0]]);
}

#[test]
fn standard_input_tells_an_archive_by_its_first_bytes() {
    let archive = npz(&[("points", bytes_of("(1, 3)", &[7; 3]))]);
    assert_eq!(read_cloud_from(&archive[..], None, Path::new("-")).unwrap().points, [[7.0; 3]]);
}

#[test]
fn malformed_files_are_refused_with_their_key() {
    let cloud = || bytes_of("(1, 3)", &[1; 3]);
    let flat = || bytes_of("(3,)", &[1; 3]);
    assert_eq!(
        error("a.npz", npz(&[("a", flat()), ("b", flat())])),
        "archive: expected an array of shape [n, 3], found the keys [a, b]"
    );
    assert_eq!(
        error("a.npz", npz(&[("a", cloud()), ("b", cloud())])),
        "archive: expected one array of points, found a, b: name one `points`"
    );
    let set = bytes_of("(2, 1, 3)", &[1; 6]);
    assert_eq!(
        error("a.npz", npz(&[("points", set)])),
        "points: expected shape [n, 3], found 2 clouds of 1 points: `edgepuck eval` classifies packed sets"
    );
    assert_eq!(
        error("a.npz", npz(&[("positions", cloud()), ("origin", flat())])),
        "origin: expected 8 bytes for each element of shape [3], found 3 bytes of |u1"
    );
    let short = npy("<f8", "False", "(2,)", &[0; 16]);
    let nan = npy("<f8", "False", "(3,)", &[255; 24]);
    for origin in [short, nan] {
        assert_eq!(
            error("a.npz", npz(&[("positions", cloud()), ("origin", origin)])),
            "origin: expected three finite numbers"
        );
    }
    let offsets = npy("<i8", "False", "(3,)", &[0; 24]);
    assert_eq!(
        error("a.npz", npz(&[("points", cloud()), ("offsets", offsets)])),
        "offsets: expected one cloud, found a packed set of 2 clouds: `edgepuck eval --data` \
         classifies them, and in NumPy the first is points[offsets[0]:offsets[1]]"
    );
    let promise = bytes_of(&format!("({MANY}, 3)"), &[1; 6]);
    assert_eq!(
        error("a.npz", npz(&[("points", promise)])),
        format!("points: the file ends after 2 of {MANY}")
    );
    assert!(error("a.npz", "PK no archive").starts_with("archive: "));
}

#[test]
fn a_byte_that_changed_on_the_way_is_noticed() {
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut stored = archive(&[("points", bytes_of("(1, 3)", &[7; 3]))], options);
    let at = stored.windows(3).position(|window| window == [7; 3]).unwrap();
    stored[at] = 8;
    assert_eq!(error("a.npz", stored), "points: Invalid checksum");
}
