//! What a point takes in each format of scans.

use formats::Scan;
use formats::hash::Hashing;
use formats::scan::AttributeSet;
use formats::scan_file::{ScanFormat, write_scan};
use glam::DVec3;
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::ScanRequest;
use sim_gpu::internals::sensor::SensorProfile;
use tests::{casting, meshes};

use super::Rows;

/// Bytes of a point in binary formats, and the columns of text.
pub fn rows(effects: &Effects, attributes: &AttributeSet) -> Rows {
    let [few, many] = [4.0, 3.0].map(|distance_m| scan(distance_m, effects, attributes));
    // Both of four digits, so that headers are of one length.
    assert!(1000 <= few.len() && few.len() < many.len() && many.len() < 10_000);
    let per_point = |format| {
        let more = bytes(&many, format).len() - bytes(&few, format).len();
        let points = many.len() - few.len();
        assert_eq!(more % points, 0, "every point takes the same");
        (more / points) as u64
    };
    let text = String::from_utf8(bytes(&few, ScanFormat::Csv)).unwrap();
    let columns = text.lines().next_back().unwrap().split(',').count() as u64;
    [
        ("point, bytes in npz", per_point(ScanFormat::Npz)),
        ("point, bytes in ply", per_point(ScanFormat::Ply)),
        ("point, columns in csv", columns),
    ]
    .map(|(row, bytes)| (row.to_owned(), bytes))
    .into()
}

fn scan(distance_m: f64, effects: &Effects, attributes: &AttributeSet) -> Scan {
    let sensor = SensorProfile::builtin("vlp32c").unwrap();
    let pattern = effects.widen(sensor.pattern(), &sensor).unwrap();
    let pose = Pose::look_at(DVec3::X * distance_m, DVec3::ZERO).unwrap();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    request.attributes = attributes.clone();
    let target = casting::target(&meshes::icosphere(4));
    sim_gpu::internals::scan::scan(&OpenCaster::Cpu(effects.clone()), &target, &request).unwrap()
}

fn bytes(scan: &Scan, format: ScanFormat) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    write_scan(&path, format, Hashing::None, scan).unwrap();
    std::fs::read(path).unwrap()
}
