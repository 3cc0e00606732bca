//! A mesh becomes scans in six steps: `read` the file, `frame` the mesh in the world, build its target, cast
//! rays at it, apply the effects of each variant to the hits, and `write_files`.
//!
//! [`prepare`] has the steps before the casters, which cast at many meshes at once (`pipeline.rs`), and
//! [`finish`] those after. [`Clouds`](crate::Clouds) does the same for one view at a time, in memory.

use crate::clouds::Source;
use crate::config::{DatasetConfig, SetConfig, Viewpoints};
use crate::error::DatasetError;
use crate::pack::keep;
use crate::plan::Plan;
use crate::progress::{Progress, Stage};
use crate::record::{FileRecord, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
use crate::view::{self, Rig, View};
use edgepuck_mesh::LoadedMesh;
use edgepuck_mesh::frame::{Normalize, Unit, Up, to_world};
use edgepuck_mesh::tree::MeshEntry;
use edgepuck_mesh::validate::triangle_stats;
use formats::Scan;
use formats::hash::{FileHash, Hashing};
use formats::plausible::{Warning, mesh_size};
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c;
use glam::{DAffine3, DVec3};
use sim_gpu::Scene;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::ray::RayFrame;
use sim_gpu::internals::scan::ObjectHits;
use sim_gpu::internals::target::{Surface, Target};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// What all meshes of a run share.
pub(crate) struct Run<'a> {
    pub plan: &'a Plan<'a>,
    pub rig: Rig<'a>,
    pub progress: &'a Progress,
    /// Bytes of the clouds that wait in memory until they are packed.
    pub kept: AtomicUsize,
}

/// A mesh, and the rays to cast at it.
pub(crate) struct Prepared<'a> {
    /// Its record, without scans.
    pub record: MeshRecord,
    /// Its views, each with a job of the same index.
    pub views: Vec<View<'a>>,
    pub jobs: Vec<CastJob>,
    /// The mesh, where the views see it.
    pub scene: Scene,
}

/// Reads the mesh of `entry` and aims every beam that may hit it.
pub(crate) fn prepare<'a>(run: &Run<'a>, entry: &MeshEntry) -> Result<Prepared<'a>, MeshFailure> {
    let (config, progress) = (run.plan.config, run.progress);
    let (record, surface) = progress.time(Stage::Read, || {
        let loaded = read(entry, config.hash)?;
        frame(entry, loaded, config.up, config.units, config.normalize)
    })?;
    warnings(&record).for_each(|warning| progress.note(warning));
    let id = record.entry.id();
    let centre = DVec3::from_array(record.views_around);
    let views = run.rig.views(&id, centre);
    let rays_of = |view: &View| {
        let frame = RayFrame::new(&surface, &DAffine3::from_translation(centre), view.pose());
        view.pattern().within(&frame.cone(view.pattern())).len()
    };
    let builder = Builder::for_rays(surface.len(), views.iter().map(rays_of).sum());
    let target = progress.time(Stage::Build, || Target::new(surface, builder));
    let scene = view::scene(config, target, centre);
    let sensors_m: Vec<DVec3> = views.iter().map(|view| view.pose().position_m).collect();
    let notes = plausibility(&record.source, config, &scene, &sensors_m);
    notes.into_iter().for_each(|note| progress.note(note));
    let placed = view::placed(&scene);
    let jobs: Vec<CastJob> =
        progress.time(Stage::Aim, || views.iter().map(|view| view.aim(&placed)).collect());
    let cast: usize = jobs.iter().map(|job| job.beams.len()).sum();
    let beams: usize = views.iter().map(|view| view.pattern().len()).sum();
    progress.rays_cast.fetch_add(cast as u64, Relaxed);
    progress.rays_culled.fetch_add((beams - cast) as u64, Relaxed);
    Ok(Prepared { record, views, jobs, scene })
}

/// What is probably wrong with the size of a mesh, with the effects or with the place of a sensor.
pub(crate) fn plausibility(
    source: &str,
    config: &DatasetConfig,
    scene: &Scene,
    sensors_m: &[DVec3],
) -> Vec<String> {
    let Some(instance) = scene.instances().first() else { return Vec::new() };
    let (extent, is_scaled) = (instance.mesh.extent(), config.normalize != Normalize::None);
    let size = mesh_size(extent.size_m(), config.units, "--units names another unit");
    let effects = extent.hidden_by(&config.effects);
    let inside = extent.surrounds(sensors_m).then(|| {
        let units = if is_scaled { "" } else { ", or another of --units" };
        let is_posed = |set: &SetConfig| matches!(set.viewpoints, Viewpoints::Poses(_));
        let place = match config.sets.iter().any(is_posed) {
            true => "poses outside of it",
            false => "a larger --distance",
        };
        Warning::SensorInside(format!("{place}{units}"))
    });
    let all = size.filter(|_| !is_scaled).into_iter().chain(effects).chain(inside);
    all.map(|warning| warning.of(source).to_string()).collect()
}

/// What is probably wrong with the file of a mesh, for the user.
pub(crate) fn warnings(record: &MeshRecord) -> impl Iterator<Item = String> {
    record.warnings.iter().map(|warning| format!("warning: {}: {warning}", record.source))
}

/// Reads the mesh of `entry`, and hashes its file.
pub(crate) fn read(
    entry: &MeshEntry,
    hashing: Hashing,
) -> Result<(LoadedMesh, Option<FileHash>), MeshFailure> {
    entry.load(hashing).map_err(|error| MeshFailure::unreadable(entry, &error))
}

/// The record of a mesh without scans, and the triangles that a ray can meet, around the origin. The mesh
/// stands where the record's `views_around` says.
pub(crate) fn frame(
    entry: &MeshEntry,
    (loaded, hash): (LoadedMesh, Option<FileHash>),
    up: Option<Up>,
    unit: Unit,
    normalize: Normalize,
) -> Result<(MeshRecord, Surface), MeshFailure> {
    let LoadedMesh { mesh, format, dropped_faces, warnings } = loaded;
    let up = up.unwrap_or(format.default_up());
    let mesh = mesh.in_metres(unit);
    let world = to_world(&mesh, up, normalize);
    let stats = triangle_stats(&world.mesh);
    if stats.kept.is_empty() {
        return Err(MeshFailure::new(entry, Warning::NoArea));
    }
    let (centre, views_around) = if normalize == Normalize::None {
        (DVec3::ZERO, world.centre)
    } else {
        (world.centre, DVec3::ZERO)
    };
    let record = MeshRecord {
        entry: entry.into(),
        source: entry.relative.clone(),
        hash,
        up,
        centre: (centre / unit.metres()).to_array(),
        scale: world.scale * unit.metres(),
        views_around: views_around.to_array(),
        triangles: mesh.triangles.len() as u64,
        dropped_faces: dropped_faces as u64,
        defects: stats.defects,
        scans: Vec::new(),
        warnings,
    };
    Ok((record, Surface::new(world.mesh, stats.kept)))
}

/// Makes every scan of a mesh of the answers of the caster to its jobs; returns its complete record.
pub(crate) fn finish(
    run: &Run,
    prepared: Prepared,
    casts: &[Cast],
) -> Result<MeshRecord, DatasetError> {
    let (Prepared { mut record, views, jobs, scene }, progress) = (prepared, run.progress);
    let placed = view::placed(&scene);
    for ((view, job), cast) in views.iter().zip(&jobs).zip(casts) {
        let hits = progress.time(Stage::Resolve, || view.resolve(job, cast));
        progress.rays_decided_in_f64.fetch_add(hits.decided_in_f64 as u64, Relaxed);
        let hits = ObjectHits::new(0, &placed, job, &hits);
        let mut variants = Vec::new();
        for &variant in &run.plan.config.variants {
            let (scan, tally) = progress.time(Stage::Resolve, || view.scan(variant, &hits))?;
            progress.scans.fetch_add(1, Relaxed);
            progress.points.fetch_add(tally.points, Relaxed);
            let source = Source { set: view.set, variant, entry: &record.entry, view: view.number };
            let files = progress
                .time(Stage::Write, || write_files(run.plan, source, view, &hits, &scan))?;
            let cloud = keep(&run.kept, run.plan.config, source, &scan);
            variants.push(VariantRecord { variant, tally, files, cloud });
        }
        record.scans.push(ScanRecord { set: view.set.name.clone(), view: view.number, variants });
    }
    Ok(record)
}

/// Writes a scan in all formats.
fn write_files(
    Plan { out, config, .. }: &Plan,
    source: Source,
    view: &View,
    hits: &ObjectHits,
    scan: &Scan,
) -> Result<Vec<FileRecord>, DatasetError> {
    let Source { set, variant, entry, view: number } = source;
    let write = |&format: &ScanFormat| {
        let path = out.join(entry.scan_file(&set.name, variant, number, format));
        let hash = match format {
            ScanFormat::Pcap => {
                let (scan, revolution) = view.packets(variant, hits)?;
                vlp32c::write(&path, config.hash, &revolution, config.returns, &scan)?
            }
            _ => write_scan(&path, format, config.hash, scan)?,
        };
        Ok(FileRecord { format, hash })
    };
    config.formats.iter().map(write).collect()
}
