use std::fs;
use std::path::Path;

use formats::FormatError;
use formats::cloud_file::read_cloud;
use formats::geometry::Trajectory;
use formats::ouster::Metadata;
use formats::weights::WeightsFile;

type Reader = fn(&Path) -> Result<(), FormatError>;

#[test]
fn stand_ins_of_files_are_named() {
    let cloud: Reader = |path| read_cloud(path).map(drop);
    let capture: Reader =
        |path| formats::pcap::read(path, |_| std::ops::ControlFlow::Continue(())).map(drop);
    let mut readers: Vec<(&str, &str, Reader)> = vec![
        ("a.pcap", "a capture", capture),
        ("a.tum", "a trajectory", |path| Trajectory::load(path).map(drop)),
        ("a.json", "metadata in JSON", |path| Metadata::read(path).map(drop)),
        ("a.safetensors", "safetensors", |path| WeightsFile::open(path).map(drop)),
    ];
    for (name, expected) in [
        ("a.ply", "ply"),
        ("a.npz", "npz"),
        ("a.npy", "npy"),
        ("a.pcd", "pcd"),
        ("a.xyz", "xyz"),
        ("a.txt", "xyz"),
        ("a.csv", "csv"),
        ("a.las", "las"),
        ("a.bin", "kitti"),
        ("a.pcd.bin", "nuscenes"),
        ("a.csv.gz", "a cloud"),
    ] {
        readers.push((name, expected, cloud));
    }
    // As `git lfs pointer` writes it, and by RFC 1952, PKWARE's APPNOTE 4.3.7 and Unicode's marks.
    let pointer = format!(
        "version https://git-lfs.github.com/spec/v1\noid sha256:{}\nsize 123456\n",
        "4d7a".repeat(16)
    );
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    let table = "x,y,z\n1.5,2.5,3.5\n".repeat(20);
    let folder = tempfile::tempdir().unwrap();
    for (bytes, found) in [
        (pointer.into_bytes(), "a Git LFS pointer: fetch the file by `git lfs pull`"),
        ([&[0xFF, 0xFE][..], &wide(&table)].concat(), "text in UTF-16: save it as UTF-8"),
        ([b"\x1F\x8B\x08\0", &[0x7f; 300][..]].concat(), "a compressed file: unpack it"),
        ([b"PK\x03\x04\x14\0", &[0x7f; 300][..]].concat(), "a compressed file: unpack it"),
        ([b"PK\x03\x04\x14\0", &[0; 25][..], b"points.npy"].concat(), "a NumPy archive (NPZ)"),
        (b"<!DOCTYPE html>\n<html><head></head></html>\n".to_vec(), "a web page"),
        ([b"\n\r\r\n\x1C\0\0\0\x4D\x3C\x2B\x1A", &[0; 60][..]].concat(), "a capture of packets"),
    ] {
        for (name, expected, read) in readers.iter().filter(|(_, it, _)| !found.starts_with(it)) {
            let path = folder.path().join(name);
            fs::write(&path, &bytes).unwrap();
            let error = read(&path).unwrap_err().to_string();
            let is_known = bytes.starts_with(b"PK") && ["npz", "safetensors"].contains(expected);
            // Readers of clouds recognise NPZ themselves.
            let is_npz = found.contains("NPZ") && error.contains("npz");
            let names_it = error.contains(found) && error.contains(name) || is_npz;
            assert!(names_it || is_known, "{name}: {error}");
        }
    }
}
