//! From what was cast at one mesh to its scans on disk.

use super::config::DatasetConfig;
use super::error::DatasetError;
use super::layout;
use super::prepare::{PlannedView, Prepared};
use super::progress::{Progress, Stage};
use super::record::{FileRecord, MeshRecord, ScanRecord, VariantRecord};
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c;
use glam::DAffine3;
use sim_gpu::effects::Effects;
use sim_gpu::job::{Cast, CastJob};
use sim_gpu::packets;
use sim_gpu::resolve::{Hits, resolve};
use sim_gpu::scan::{ObjectHits, ScanRequest, assemble};
use sim_gpu::sensor::BeamPattern;
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;

/// What all meshes of a run share.
pub struct Output<'a> {
    /// The dataset's folder.
    pub out: &'a Path,
    /// What it is to hold.
    pub config: &'a DatasetConfig,
    /// Each set's beams.
    pub patterns: &'a [BeamPattern],
    /// The effects that are cast.
    pub cast_effects: &'a Effects,
    /// Counters.
    pub progress: &'a Progress,
}

/// Writes every scan of one mesh; returns its record, complete.
///
/// # Errors
/// If a file cannot be written.
pub fn write_mesh(
    output: &Output,
    prepared: Prepared,
    casts: &[Cast],
) -> Result<MeshRecord, DatasetError> {
    let Prepared { mut record, views, jobs } = prepared;
    for ((planned, job), cast) in views.iter().zip(&jobs).zip(casts) {
        let hits = output.progress.time(Stage::Resolve, || {
            resolve(job, cast, &output.patterns[planned.set], output.cast_effects)
        });
        output.progress.rays_decided_in_f64.fetch_add(hits.decided_in_f64 as u64, Relaxed);
        let scan = write_view(output, &record, planned, job, &hits)?;
        record.scans.push(scan);
    }
    Ok(record)
}

fn write_view(
    output: &Output,
    record: &MeshRecord,
    planned: &PlannedView,
    job: &CastJob,
    hits: &Hits,
) -> Result<ScanRecord, DatasetError> {
    let config = output.config;
    let set = &config.sets[planned.set];
    let world_from_object = DAffine3::IDENTITY;
    let objects = [ObjectHits { object: 0, world_from_object, job, hits }];
    let mut variants = Vec::new();
    for &variant in &config.variants {
        let mut request =
            ScanRequest::new(&set.sensor, &output.patterns[planned.set], planned.pose);
        request.effects = Some(config.effects_of(set, variant)?);
        (request.attributes, request.stream) = (config.attributes.clone(), job.stream);
        let (scan, tally) = output
            .progress
            .time(Stage::Resolve, || assemble(&request, output.cast_effects, &objects))?;
        output.progress.scans.fetch_add(1, Relaxed);
        output.progress.points.fetch_add(tally.points, Relaxed);
        let files: Result<_, DatasetError> = output.progress.time(Stage::Write, || {
            config
                .formats
                .iter()
                .map(|&format| {
                    let (out, entry) = (output.out, &record.entry);
                    let path = layout::scan(out, &set.name, variant, entry, planned.view, format);
                    let sha256 = match format {
                        ScanFormat::Pcap => write_packets(output, &path, &request, &objects)?,
                        _ => write_scan(&path, format, &scan)?,
                    };
                    Ok(FileRecord { format, sha256 })
                })
                .collect()
        });
        variants.push(VariantRecord { variant, tally, files: files? });
    }
    Ok(ScanRecord { set: set.name.clone(), view: planned.view, variants })
}

/// Writes the packets of one view, whatever attributes its points have.
fn write_packets(
    output: &Output,
    path: &Path,
    request: &ScanRequest,
    objects: &[ObjectHits],
) -> Result<String, DatasetError> {
    let revolution = packets::revolution(request.sensor)?;
    let effects = request.applied_effects(output.cast_effects)?;
    let mut request = request.clone();
    request.attributes = packets::attributes(&effects);
    let (scan, _) = assemble(&request, output.cast_effects, objects)?;
    Ok(vlp32c::write(path, &revolution, output.config.returns, &scan)?)
}
