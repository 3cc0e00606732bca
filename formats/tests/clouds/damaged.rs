//! No bytes, however damaged or made up, make a reader panic or take memory
//! that they do not justify.

use std::path::Path;
use std::sync::LazyLock;

use formats::cloud_file::{CloudFormat, read_cloud_from, write_cloud};
use proptest::prelude::*;

/// Files to be damaged: some of ours, and some with more in them.
static WHOLE_FILES: LazyLock<Vec<(CloudFormat, Vec<u8>)>> = LazyLock::new(whole_files);

fn whole_files() -> Vec<(CloudFormat, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let points: Vec<_> = (0..20).map(f64::from).map(|i| [i * 0.1, -1e-30, i * 1e30]).collect();
    let extensions = ["ply", "npz", "npy", "pcd", "xyz", "csv"];
    let mut files: Vec<_> = extensions
        .into_iter()
        .map(|extension| {
            let path = folder.path().join("cloud").with_extension(extension);
            write_cloud(&path, &points).unwrap();
            (CloudFormat::of_path(&path).unwrap(), std::fs::read(&path).unwrap())
        })
        .collect();
    files.push((CloudFormat::Kitti, [0.1f32, -1e-30, 1e30, 0.0].map(f32::to_le_bytes).concat()));
    let ply = "element a 1\nproperty list uchar int l\nelement vertex 2\nproperty double x\n\
               property list char short l\nproperty uint y\nproperty char z\nend_header\n\
               1 2 -.5 1 7 8 9\n";
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let text = format!("ply\nformat {encoding} 1.0\ncomment origin 1 2 3\n{ply}");
        files.push((CloudFormat::Ply, [text.as_bytes(), &[1; 60]].concat()));
    }
    for encoding in ["ascii", "binary", "binary_compressed"] {
        let text = format!(
            "FIELDS a x y z\nSIZE 1 1 1 1\nTYPE U U I I\nCOUNT 1 1 1 1\nPOINTS 2\nDATA {encoding}\n"
        );
        let data = [9, 0, 0, 0, 8, 0, 0, 0, 7, 1, 2, 3, 4, 5, 6, 7, 8];
        files.push((CloudFormat::Pcd, [text.as_bytes(), &data].concat()));
    }
    let mut las = vec![0; 227 + 60];
    las[..4].copy_from_slice(b"LASF");
    (las[24], las[25], las[94], las[96], las[105], las[107]) = (1, 2, 227, 227, 20, 3);
    for scale in [131, 139, 147] {
        las[scale..scale + 8].copy_from_slice(&1.0f64.to_le_bytes());
    }
    files.push((CloudFormat::Las, las));
    files
}

#[test]
fn the_files_are_whole_before_they_are_damaged() {
    for (format, bytes) in &*WHOLE_FILES {
        let read = read_cloud_from(&bytes[..], Some(*format), Path::new("a"));
        // The binary PLY and the text of PCD need not make sense.
        if !matches!(format, CloudFormat::Ply | CloudFormat::Pcd) {
            assert!(read.is_ok_and(|cloud| !cloud.points.is_empty()), "{format}");
        }
    }
}

#[test]
fn a_file_may_be_cut_anywhere() {
    for (format, bytes) in &*WHOLE_FILES {
        for end in 0..bytes.len() {
            let _ = read_cloud_from(&bytes[..end], Some(*format), Path::new("a"));
            let _ = read_cloud_from(&bytes[..end], None, Path::new("a"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_file_may_be_changed_anywhere(
        which in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (format, mut bytes) = which.get(&WHOLE_FILES[..]).clone();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read_cloud_from(&bytes[..], Some(format), Path::new("a"));
    }
}
