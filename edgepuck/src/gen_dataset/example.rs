//! The example picture of a dataset: one mesh from all its viewpoints.

use crate::view::frame::Frame;
use crate::view::preview;
use edgepuck_dataset::{DatasetFolder, Manifest, MeshRecord, Variant};
use formats::Scan;
use formats::scan_file::{ScanFormat, read_scan};
use glam::DVec3;
use sim_gpu::Pose;
use std::path::{Path, PathBuf};

/// Draws a mesh from the middle of the list that fills a packed cloud, or else the mesh with the
/// most points. Returns `None` if no scan holds a point.
pub fn draw(out: &Path, manifest: &Manifest) -> anyhow::Result<Option<PathBuf>> {
    let Some(set) = manifest.config.sets.first() else { return Ok(None) };
    let points = |record: &&MeshRecord| -> u64 {
        let of_set = record.scans.iter().filter(|scan| scan.set == set.name);
        of_set.filter_map(|scan| scan.variants.first()).map(|v| v.tally.points).sum()
    };
    let enough = u64::from(manifest.config.packed_points);
    let (before, after) = manifest.meshes.split_at(manifest.meshes.len() / 2);
    let full = after.iter().chain(before).find(|record| points(record) >= enough);
    let most = full.or_else(|| manifest.meshes.iter().max_by_key(points));
    let Some(record) = most.filter(|record| points(record) > 0) else { return Ok(None) };
    let centre = DVec3::from_array(record.views_around);
    let poses = set.poses(manifest.config.seed, &record.entry.id(), centre);
    let noisy = Some(Variant::Noisy).filter(|noisy| manifest.config.variants.contains(noisy));
    let scan = all_views(out, record, &set.name, noisy.unwrap_or(Variant::Clean), &poses)?;
    let picture = DatasetFolder(out).picture_file();
    preview::draw(&Frame::of_scan(String::new(), scan, Vec::new()), &picture)?;
    Ok(Some(picture))
}

/// The scans of all views as one cloud with ranges, around the centre of the mesh.
fn all_views(
    out: &Path,
    record: &MeshRecord,
    set: &str,
    variant: Variant,
    poses: &[Pose],
) -> anyhow::Result<Scan> {
    let mut positions = Vec::new();
    let mut ranges_m = Vec::new();
    let centre = DVec3::from_array(record.views_around);
    for (pose, view) in poses.iter().zip(0..) {
        let file = out.join(record.entry.scan_file(set, variant, view, ScanFormat::Npz));
        let scan = read_scan(&file)?;
        let origin = DVec3::from_array(scan.origin);
        for position in scan.positions {
            let point = origin + DVec3::from_array(position.map(f64::from));
            ranges_m.push(point.distance(pose.position_m) as f32);
            positions.push((point - centre).as_vec3().to_array());
        }
    }
    Ok(Scan { positions, range_m: Some(ranges_m), ..Scan::default() })
}
