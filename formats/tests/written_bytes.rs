//! What datasets consist of is written as it ever was, to the byte: manifests
//! list the hashes.

use formats::Scan;
use formats::hash::{FileHash, Hashing};
use formats::packed::PackedWriter;
use formats::scan_file::ScanFormat::{Csv, Npz, Ply};
use formats::scan_file::write_scan;

/// A scan of `n` points with every attribute.
pub fn scan(n: usize, origin: [f64; 3]) -> Scan {
    let real = |scale: f32| Some((0..n).map(|i| i as f32 * scale).collect());
    let whole = |first: u32| Some((0..n as u32).map(|i| first + i).collect());
    Scan {
        origin,
        pose: None,
        positions: (0..n).map(|i| [i as f32 * 0.1, -1e-30, f32::MAX]).collect(),
        range_m: real(1.1),
        beam: whole(7),
        ring: Some((0..n).map(|i| i as u16).collect()),
        time_s: real(2.304e-6),
        triangle: whole(1 << 31),
        object: whole(0),
        object_texts: Default::default(),
        intensity: real(0.01),
        power: real(1e-3),
        reflectivity: Some((0..n).map(|i| i as u8).collect()),
        return_number: Some((0..n).map(|i| i as u8).collect()),
        medium: Some((0..n).map(|i| i as u8).collect()),
        sensor_m: Some((0..n).map(|i| [i as f32, 0.0, 1.0]).collect()),
        attitude_rad: Some((0..n).map(|i| [0.0, 0.0, i as f32]).collect()),
        normal: Some((0..n).map(|i| [0.0, i as f32, -1.0]).collect()),
    }
}

#[test]
fn a_scan_is_written_as_it_ever_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    let hash_of = |format, n, origin| {
        // The attributes that there were when these hashes were taken.
        let all = scan(n, origin);
        let scan = Scan {
            origin,
            positions: all.positions,
            range_m: all.range_m,
            beam: all.beam,
            ring: all.ring,
            time_s: all.time_s,
            triangle: all.triangle,
            object: all.object,
            intensity: all.intensity,
            normal: all.normal,
            ..Scan::default()
        };
        let found = write_scan(&path, format, Hashing::Sha256, &scan).unwrap();
        assert_eq!(found, Hashing::Sha256.of_file(&path).unwrap(), "{format} of {n} points");
        found
    };
    let (near, far) = ([0.0; 3], [1e7, -0.5, 0.0]);
    for (format, n, origin, hash) in [
        (Npz, 0, near, "0d6ff950c58f740063e80664529d15a95221ca297daa6fd50fbe0f24d9cbee20"),
        (Npz, 1, far, "e8c0b6dd5816b900bbb08300ce0dd56968c6b24a2b4d0b844b5d7fb23a2c0ec3"),
        (Npz, 5000, near, "19b2c2e9b7f40f1073137b5f696ab4c0612a736b4e672cb834a1efd4fd0eaf15"),
        (Ply, 5000, far, "1058ab91220e86d2bab9f93690951ecdac2038b541142633a361343eefa55a4d"),
        (Csv, 5000, far, "f56d5af0f7e370e680e2b19154ba675b446576498af07dcea024154504289c72"),
    ] {
        let hash = Some(FileHash { sha256: hash.to_owned() });
        assert_eq!(hash_of(format, n, origin), hash, "{format} of {n} points");
    }
}

#[test]
fn a_packed_set_is_written_as_it_ever_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let hash_of = |m: usize| {
        let classes = ["bowl", "étagère"].map(str::to_owned).to_vec();
        let mut writer = PackedWriter::create(&path, 64, classes).unwrap();
        for i in 0..m {
            let cloud: Vec<_> = (0..64).map(|j| [i as f32, j as f32, 0.5]).collect();
            writer.push(&cloud, i % 2, &format!("mesh_{i}_v0"), 10 + i as u32).unwrap();
        }
        let found = writer.finish(Hashing::Sha256).unwrap();
        assert_eq!(found, Hashing::Sha256.of_file(&path).unwrap(), "{m} clouds");
        found
    };
    for (m, hash) in [
        (0, "2c32501de24f92aeb91e6a6130a89f382200b2eab2fbed12e120064c76fcdd88"),
        (1, "3237d3c694e014be7d3cba50ff25ec09fc6b90c4cf635129926555b810770719"),
        (700, "827d109ef1d90f84e355adb3d754328bcefe96a1013fae67bcfe136c7778d261"),
    ] {
        assert_eq!(hash_of(m), Some(FileHash { sha256: hash.to_owned() }), "{m} clouds");
    }
}
