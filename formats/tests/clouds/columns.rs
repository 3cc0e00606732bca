use std::fs;

use formats::Scan;
use formats::cloud_file::read_cloud_as;
use formats::hash::Hashing;
use formats::scan_file::{ScanFormat, write_scan};

use super::las::las;
use crate::numpy::{npy, npz};

fn read(path: &std::path::Path) -> Option<Vec<f32>> {
    let cloud = read_cloud_as(path, None).unwrap();
    assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    cloud.intensities
}

#[test]
fn columns_of_intensities_are_known_by_their_names() {
    let pcd = |field: &str, data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x {field} y z\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\n\
             HEIGHT 1\nPOINTS 2\nDATA ascii\n{data}"
        )
    };
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty uchar scalar_Intensity\n\
               property float x\nproperty float y\nproperty float z\nend_header\n7 1 2 3\n8 4 5 6\n";
    let lines = "1 .5 2 3\n4 1 5 6\n";
    let xyz = || ("points", npy("|u1", "False", "(2, 3)", &[1, 2, 3, 4, 5, 6]));
    let column =
        |key, descr, shape, data: &[u8]| npz(&[xyz(), (key, npy(descr, "False", shape, data))]);
    let halves = [0.5f64, 1.0].map(f64::to_le_bytes).concat();
    for (name, bytes, expected) in [
        ("a.pcd", pcd("intensity", lines).into_bytes(), Some([0.5, 1.0])),
        ("a.pcd", pcd("I", lines).into_bytes(), Some([0.5, 1.0])),
        ("a.pcd", pcd("reflectivity", "1 50 2 3\n4 100 5 6\n").into_bytes(), Some([0.5, 1.0])),
        ("a.pcd", pcd("reflectivity", lines).into_bytes(), Some([0.5, 1.0])),
        ("a.pcd", pcd("rgb", lines).into_bytes(), None),
        ("a.csv", b"x,Intensity,y,z,i\n1,200,2,3,0\n4,50,5,6,0\n".into(), Some([200.0, 50.0])),
        ("a.xyz", b"# X I Y Z\n1 .5 2 3\n4 1 5 6\n".into(), Some([0.5, 1.0])),
        ("a.csv", b"x,y,z,i\n1,2,3,one\n4,5,6\n".into(), Some([f32::NAN; 2])),
        ("a.xyz", b"1 2 3 .5\n4 5 6 1\n".into(), None),
        ("a.ply", ply.into(), Some([7.0, 8.0])),
        ("a.npz", column("intensity", "<f8", "(2,)", &halves), Some([0.5, 1.0])),
        ("a.npz", column("Intensity", "|u1", "(2, 1)", &[7, 8]), Some([7.0, 8.0])),
        ("a.npz", column("reflectivity", "|u1", "(2,)", &[50, 100]), Some([0.5, 1.0])),
        ("a.npz", column("colour", "|u1", "(2,)", &[7, 8]), None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, &bytes).unwrap();
        let (found, text) = (read(&path), String::from_utf8_lossy(&bytes));
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{text}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    fs::write(&path, column("intensity", "|u1", "(3,)", &[7; 3])).unwrap();
    let error = read_cloud_as(&path, None).unwrap_err().to_string();
    assert!(
        error.ends_with("intensity: expected 2 values, one for each point, found 3"),
        "{error}"
    );
}

#[test]
fn columns_of_rings_are_known_by_their_names() {
    let pcd = |rings: [u8; 2]| {
        let header = "VERSION 0.7\nFIELDS x y z ring\nSIZE 4 4 4 2\nTYPE F F F U\nWIDTH 2\nHEIGHT 1\n\
                      VIEWPOINT 0 0 2 1 0 0 0\nPOINTS 2\nDATA ascii\n";
        format!("{header}1 2 3 {}\n4 5 6 {}\n", rings[0], rings[1]).into_bytes()
    };
    let xyz = npy("|u1", "False", "(2, 3)", &[1, 2, 3, 4, 5, 6]);
    let nuscenes = [1.0f32, 2.0, 3.0, 9.0, 31.0, 4.0, 5.0, 6.0, 9.0, 0.0];
    for (name, bytes, expected) in [
        ("a.pcd", pcd([31, 0]), Some([31, 0])),
        ("a.pcd", pcd([0, 0]), Some([0, 0])),
        ("a.csv", b"x,y,z,scalar_Ring,intensity\n1,2,3,31,0\n4,5,6,0,0\n".into(), Some([31, 0])),
        ("a.csv", b"x,y,z,ring\n1,2,3,0.5\n4,5,6,1\n".into(), None),
        (
            "a.npz",
            npz(&[("points", xyz), ("ring", npy("|u1", "False", "(2,)", &[31, 0]))]),
            Some([31, 0]),
        ),
        ("a.pcd.bin", nuscenes.map(f32::to_le_bytes).concat(), Some([31, 0])),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, &bytes).unwrap();
        let cloud = read_cloud_as(&path, None).unwrap();
        assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(cloud.rings, expected.map(Vec::from), "{name}");
        let height_m = if name == "a.pcd" { 2.0 } else { 0.0 };
        assert_eq!(cloud.sensor_position_m(), [0.0, 0.0, height_m]);
    }
}

/// The largest intensity of LAS is 65535, and 0 stands for none (LAS 1.4 R15, 2.6.2).
#[test]
fn written_columns_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let positions = vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
    let scan = Scan { positions, intensity: Some(vec![0.3, 1.0]), ..Scan::default() };
    for format in [ScanFormat::Npz, ScanFormat::Ply, ScanFormat::Csv, ScanFormat::Pcd] {
        let path = folder.path().join("scan").with_extension(format.name());
        write_scan(&path, format, Hashing::None, &scan).unwrap();
        assert_eq!(read(&path), scan.intensity, "{format}");
    }
    let path = folder.path().join("scan.las");
    for (written, expected) in
        [([13107, 65535], Some(vec![0.2, 1.0])), ([0, 255], Some(vec![0.0, 255.0])), ([0, 0], None)]
    {
        let points = [([1.0, 2.0, 3.0], written[0]), ([4.0, 5.0, 6.0], written[1])];
        fs::write(&path, las((1, 2), 0, [0.0; 3], &points)).unwrap();
        assert_eq!(read(&path), expected);
    }
}
