//! The picture that a run ends with: one mesh from all its views, clean above
//! noisy.

use formats::Scan;
use formats::scan_file::{ScanFormat, read_scan};
use sim_gpu::dataset::config::Variant;
use sim_gpu::dataset::layout;
use sim_gpu::dataset::manifest::Manifest;
use sim_gpu::dataset::record::MeshRecord;
use std::path::{Path, PathBuf};
use xtask::preview;

/// Draws the mesh with the most points of the first set; `None` if no scan
/// holds a point.
pub fn draw(out: &Path, manifest: &Manifest) -> anyhow::Result<Option<PathBuf>> {
    let Some(set) = manifest.config.sets.first() else { return Ok(None) };
    let points = |record: &&MeshRecord| -> u64 {
        let of_set = record.scans.iter().filter(|scan| scan.set == set.name);
        of_set.filter_map(|scan| scan.variants.first()).map(|v| v.tally.points).sum()
    };
    let most = manifest.meshes.iter().max_by_key(points);
    let Some(record) = most.filter(|record| points(record) > 0) else { return Ok(None) };
    let clean = all_views(out, record, &set.name, Variant::Clean)?;
    let noisy = if manifest.config.variants.contains(&Variant::Noisy) {
        Some(all_views(out, record, &set.name, Variant::Noisy)?)
    } else {
        None
    };
    let title = format!(
        "{} from {} views, {}",
        record.entry.name,
        views(record, &set.name),
        set.sensor.name
    );
    let picture = layout::example(out);
    preview::draw(&clean, noisy.as_ref(), &title, &picture)?;
    Ok(Some(picture))
}

fn views(record: &MeshRecord, set: &str) -> usize {
    record.scans.iter().filter(|scan| scan.set == set).count()
}

/// The scans of all views as one cloud.
fn all_views(out: &Path, record: &MeshRecord, set: &str, variant: Variant) -> anyhow::Result<Scan> {
    let mut all = Scan::default();
    let mut ranges = Some(Vec::new());
    for scan in record.scans.iter().filter(|scan| scan.set == set) {
        let file = layout::scan(out, set, variant, &record.entry, scan.view, ScanFormat::Npz);
        let view = read_scan(&file)?;
        all.positions.extend(view.positions);
        ranges = ranges.zip(view.range_m).map(|(mut all, of_view)| {
            all.extend(of_view);
            all
        });
    }
    all.range_m = ranges;
    Ok(all)
}
