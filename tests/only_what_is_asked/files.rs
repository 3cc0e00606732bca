//! What a point takes in each format of scans.

use formats::Scan;
use formats::scan::AttributeSet;
use formats::scan_file::{ScanFormat, write_scan};
use glam::DVec3;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::pose::Pose;
use sim_gpu::scan::ScanRequest;
use sim_gpu::sensor::Sensor;

use super::Rows;
use super::travel::sphere;

/// Bytes of a point in binary formats, and the columns of text.
pub fn rows(effects: &Effects, attributes: &AttributeSet) -> Rows {
    let scan = scan(effects, attributes);
    // Both of four digits, so that headers are of one length.
    let [few, many] = [1024, 2048].map(|points| cut(&scan, points));
    let per_point = |format| {
        let more = bytes(&many, format).len() - bytes(&few, format).len();
        assert_eq!(more % 1024, 0, "every point takes the same");
        (more / 1024) as u64
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

fn scan(effects: &Effects, attributes: &AttributeSet) -> Scan {
    let (job, pattern) = sphere();
    let sensor = Sensor::builtin("vlp32c").unwrap();
    let pose = Pose::look_at(DVec3::new(3.0, 0.0, 0.0), DVec3::ZERO).unwrap();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    (request.attributes, request.stream) = (attributes.clone(), job.stream);
    sim_gpu::scan(&Caster::Cpu(effects.clone()), &job.target, &request).unwrap()
}

/// The first points of `scan`.
fn cut(scan: &Scan, points: usize) -> Scan {
    fn head<T: Clone>(column: &Option<Vec<T>>, points: usize) -> Option<Vec<T>> {
        column.as_ref().map(|column| column[..points].to_vec())
    }
    Scan {
        origin: scan.origin,
        positions: scan.positions[..points].to_vec(),
        range_m: head(&scan.range_m, points),
        beam: head(&scan.beam, points),
        ring: head(&scan.ring, points),
        time_s: head(&scan.time_s, points),
        triangle: head(&scan.triangle, points),
        object: head(&scan.object, points),
        intensity: head(&scan.intensity, points),
        normal: head(&scan.normal, points),
    }
}

fn bytes(scan: &Scan, format: ScanFormat) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    write_scan(&path, format, scan).unwrap();
    std::fs::read(path).unwrap()
}
