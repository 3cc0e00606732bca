use std::fs;
use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud, read_cloud_as, read_cloud_from, write_cloud};
use proptest::prelude::*;

const LOSSLESS: [&str; 5] = ["ply", "npz", "npy", "xyz", "csv"];
const ALL: [&str; 6] = ["ply", "npz", "npy", "xyz", "csv", "pcd"];

/// Coordinates as bits, so that NaN is itself and -0 is not 0.
fn bits(points: &[[f64; 3]]) -> Vec<u64> {
    let bits = |x: &f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
    points.as_flattened().iter().map(bits).collect()
}

fn there_and_back(extension: &str, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud").with_extension(extension);
    write_cloud(&path, points).unwrap();
    let named = read_cloud_as(&path, CloudFormat::of_path(&path).ok()).unwrap().points;
    let file = fs::File::open(&path).unwrap();
    assert_eq!(bits(&read_cloud_from(file, None, Path::new("-")).unwrap().points), bits(&named));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    named
}

proptest! {
    #[test]
    fn any_cloud_comes_back(
        points in prop::collection::vec(prop::array::uniform3(any::<f64>()), 0..40),
    ) {
        for extension in LOSSLESS {
            prop_assert_eq!(bits(&there_and_back(extension, &points)), bits(&points), "{}", extension);
        }
    }

    #[test]
    fn pcd_keeps_a_millionth_of_the_extent(
        points in prop::collection::vec(prop::array::uniform3(0.0f64..1.0), 0..40),
        distance in -1e9f64..1e9,
    ) {
        let corners = [[0.0; 3], [1.0; 3]];
        let points: Vec<_> =
            corners.iter().chain(&points).map(|point| point.map(|x| distance + x)).collect();
        let read = there_and_back("pcd", &points);
        for (read, point) in read.as_flattened().iter().zip(points.as_flattened()) {
            // The extent is 1, but for the rounding of its two ends: 2e-7 at
            // 1e9.
            prop_assert!((read - point).abs() <= 1e-6 * (1.0 + 3e-7));
        }
    }

    #[test]
    fn a_cloud_of_f32_comes_back(
        points in prop::collection::vec(prop::array::uniform3(any::<f32>()), 0..40),
    ) {
        let points: Vec<_> = points.into_iter().map(|point| point.map(f64::from)).collect();
        for extension in ALL {
            prop_assert_eq!(bits(&there_and_back(extension, &points)), bits(&points), "{}", extension);
        }
    }
}

#[test]
fn f32_is_written_where_it_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let size = |extension: &str, x: f64| {
        let path = folder.path().join("cloud").with_extension(extension);
        write_cloud(&path, &vec![[x, 0.0, f64::NAN]; 1000]).unwrap();
        fs::metadata(path).unwrap().len()
    };
    for extension in ["ply", "npz", "npy"] {
        let (single, double) = (size(extension, f64::from(0.1f32)), size(extension, 0.1));
        assert!((12_000..13_000).contains(&single), "{extension}: {single}");
        assert!((24_000..25_000).contains(&double), "{extension}: {double}");
    }
}

#[test]
fn pcd_holds_f64_only_where_f32_would_not_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.pcd");
    let written = |points: &[[f64; 3]]| {
        write_cloud(&path, points).unwrap();
        let bytes = fs::read(&path).unwrap();
        String::from_utf8_lossy(&bytes)
            .lines()
            .find(|line| line.starts_with("SIZE"))
            .unwrap()
            .to_owned()
    };
    assert_eq!(written(&[[0.1, 0.2, 0.3], [1.1, f64::NAN, 0.0]]), "SIZE 4 4 4");
    assert_eq!(written(&[[4.5e6 + 0.1, 0.2, 0.3], [4.5e6 + 1.1, 0.0, 0.0]]), "SIZE 8 8 8");
    assert_eq!(written(&[[0.1; 3], [0.1; 3]]), "SIZE 8 8 8");
    assert_eq!(written(&[[1e300; 3], [-1e300; 3]]), "SIZE 8 8 8");
    assert_eq!(written(&[]), "SIZE 4 4 4");
}

#[test]
fn text_is_as_short_as_it_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let written = |name: &str| {
        let path = folder.path().join(name);
        write_cloud(&path, &[[0.1, -0.0, 1e300], [1.0, f64::NAN, f64::INFINITY]]).unwrap();
        fs::read_to_string(path).unwrap()
    };
    assert_eq!(written("a.xyz"), "0.1 -0.0 1e300\n1.0 NaN inf\n");
    assert_eq!(written("a.csv"), "x,y,z\n0.1,-0.0,1e300\n1.0,NaN,inf\n");
}

#[test]
fn formats_that_are_only_read_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, cause) in [
        ("a.las", "extension: expected a format to write: .ply, .npz, .npy, .pcd, .xyz or .csv"),
        ("a.bin", "extension: expected a format to write: "),
        ("a.off", "extension: expected a cloud, found a mesh: scan it first"),
    ] {
        let message = write_cloud(&folder.path().join(name), &[[0.0; 3]]).unwrap_err().to_string();
        assert!(message.contains(&format!("{name}: {cause}")), "{message}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn errors_name_the_file() {
    let missing = read_cloud(Path::new("no/such.ply")).unwrap_err().to_string();
    assert!(missing.starts_with("no/such.ply: "), "{missing}");
}
