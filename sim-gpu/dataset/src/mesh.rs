//! One mesh: from its file to the rays that are cast at it, and from what was cast
//! to its scans on disk.

use super::clouds::Source;
use super::config::{DatasetConfig, SetConfig};
use super::error::DatasetError;
use super::layout;
use super::progress::{Progress, Stage};
use super::record::{Cloud, FileRecord, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
use formats::hash::{FileHash, Hashing};
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c;
use glam::DAffine3;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::job::{Cast, CastJob, Culling};
use sim_gpu::internals::material::{Material, MaterialChoice, MaterialError, Materials};
use sim_gpu::internals::mesh::frame::{Normalize, Up, to_world};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::mesh::validate::triangle_stats;
use sim_gpu::internals::mesh::{LoadedMesh, MeshError, TriangleMesh, load_hashed};
use sim_gpu::internals::packets;
use sim_gpu::internals::pose::{Pose, Trajectory};
use sim_gpu::internals::ray::RayFrame;
use sim_gpu::internals::resolve::{Hits, resolve};
use sim_gpu::internals::scan::{ObjectHits, PlacedTarget, ScanRequest, assemble};
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::simplify::{Simplified, Viewpoint, resolved_m, simplified_surface};
use sim_gpu::internals::target::{Surface, Target};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A mesh and everything that is to be cast at it.
pub struct Prepared {
    /// Its record, without scans.
    pub record: MeshRecord,
    /// Its views, each with a job of the same number.
    pub views: Vec<PlannedView>,
    /// The rays of each view.
    pub jobs: Vec<CastJob>,
    /// The materials of the mesh, where they are asked for.
    pub materials: Option<Materials>,
}

/// One view of one mesh.
pub struct PlannedView {
    /// The set's place in the configuration.
    pub set: usize,
    /// The view's number in its set.
    pub view: u32,
    /// Where the sensor stands.
    pub pose: Pose,
    /// How it moves, if it does.
    pub motion: Option<Arc<Trajectory>>,
}

/// Reads the mesh of `entry` and aims every beam that may hit it.
///
/// # Errors
/// Says why the mesh cannot be scanned.
pub fn prepare(
    entry: &MeshEntry,
    config: &DatasetConfig,
    patterns: &[BeamPattern],
    culling: Culling,
    progress: &Progress,
) -> Result<Prepared, MeshFailure> {
    let (mut record, mesh, kept) = progress
        .time(Stage::Read, || read(entry, config.up, config.normalize, config.hash))
        .map_err(|error| failure(entry, &error))?;
    let materials = materials(entry, config)?;
    let id = record.entry.id();
    let views = plan(config, &id, patterns);
    let surface = match config.simplify {
        None => Surface::new(mesh, kept),
        Some(simplify) => {
            let bound_m = simplify.bound_m(|| resolved_m(&mesh, 1.0, &viewpoints(config, &views)));
            let surface = progress
                .time(Stage::Build, || simplified_surface(mesh, kept, bound_m))
                .map_err(|error| failed(entry, None, error.to_string()))?;
            record.simplified = Some(Simplified { bound_m, triangles: surface.len() as u64 });
            surface
        }
    };
    let rays = views
        .iter()
        .map(|view| {
            let pattern = &patterns[view.set];
            let frame = RayFrame::new(&surface, &DAffine3::IDENTITY, &view.pose);
            pattern.within(&frame.cone(pattern)).len()
        })
        .sum();
    let builder = Builder::for_rays(surface.len(), rays);
    let target = progress.time(Stage::Build, || Target::new(surface, builder));
    let jobs: Vec<CastJob> = progress.time(Stage::Aim, || {
        let aim = |view: &PlannedView| {
            let mut request = view.request(config, patterns, &id);
            request.culling = culling;
            request.aim(&placed(config, &target, materials.as_ref()))
        };
        views.iter().map(aim).collect()
    });
    let cast: usize = jobs.iter().map(|job| job.beams.len()).sum();
    let beams: usize = views.iter().map(|view| patterns[view.set].len()).sum();
    progress.rays_cast.fetch_add(cast as u64, Relaxed);
    progress.rays_culled.fetch_add((beams - cast) as u64, Relaxed);
    Ok(Prepared { record, views, jobs, materials })
}

impl PlannedView {
    /// A view of set number `set` from this pose.
    pub(super) fn new(
        config: &DatasetConfig,
        patterns: &[BeamPattern],
        set: usize,
        view: u32,
        pose: Pose,
    ) -> Self {
        let moves = config.effects.motion.as_deref();
        let motion = moves.map(|motion| motion.trajectory(pose, [0.0, patterns[set].last_s()]));
        Self { set, view, pose, motion: motion.map(Arc::new) }
    }

    /// The scan of this view of the mesh called `id`: clean, unless effects are added.
    pub(super) fn request<'a>(
        &self,
        config: &'a DatasetConfig,
        patterns: &'a [BeamPattern],
        id: &str,
    ) -> ScanRequest<'a> {
        let set = &config.sets[self.set];
        let mut request = ScanRequest::new(&set.sensor, &patterns[self.set], self.pose);
        request.motion.clone_from(&self.motion);
        request.stream = set.stream(config.seed, id, self.view);
        request
    }
}

/// A mesh where every mesh of a dataset stands.
pub(super) fn placed<'a>(
    config: &DatasetConfig,
    target: &'a Target,
    materials: Option<&'a Materials>,
) -> PlacedTarget<'a> {
    let mut placed = PlacedTarget::new(target);
    (placed.reflectivity, placed.materials) = (config.reflectivity as f32, materials);
    placed
}

pub(super) fn materials(
    entry: &MeshEntry,
    config: &DatasetConfig,
) -> Result<Option<Materials>, MeshFailure> {
    let otherwise = Material::diffuse(config.reflectivity);
    let choice = MaterialChoice { colours: config.colours, ..MaterialChoice::default() };
    let load = || Materials::load(&entry.path, &choice, otherwise);
    config.colours.map(|_| load()).transpose().map_err(|error| match error {
        MaterialError::Mesh(error) => failure(entry, &error),
        other => failed(entry, None, other.to_string()),
    })
}

fn plan(config: &DatasetConfig, id: &str, patterns: &[BeamPattern]) -> Vec<PlannedView> {
    let of_set = |(set, set_config): (usize, &SetConfig)| {
        let poses = set_config.poses(config.seed, id).into_iter().zip(0..);
        poses.map(move |(pose, view)| PlannedView::new(config, patterns, set, view, pose))
    };
    config.sets.iter().enumerate().flat_map(of_set).collect()
}

/// Each set's sensor, where it stands.
fn viewpoints<'a>(config: &'a DatasetConfig, views: &[PlannedView]) -> Vec<Viewpoint<'a>> {
    let of_set = |(set, config): (usize, &'a SetConfig)| {
        let its_own = views.iter().filter(|view| view.set == set);
        let positions = its_own.map(|view| view.pose.position_m).collect();
        Viewpoint { sensor: &config.sensor, positions }
    };
    config.sets.iter().enumerate().map(of_set).collect()
}

pub(super) fn read(
    entry: &MeshEntry,
    up: Option<Up>,
    normalize: Normalize,
    hashing: Hashing,
) -> Result<(MeshRecord, TriangleMesh, Vec<u32>), MeshError> {
    let (LoadedMesh { mesh, format, dropped_faces }, hash) = load_hashed(&entry.path, hashing)?;
    let up = up.unwrap_or(format.default_up());
    let world = to_world(&mesh, up, normalize);
    let stats = triangle_stats(&world.mesh);
    let record = MeshRecord {
        entry: entry.into(),
        source: entry.relative.clone(),
        hash,
        up,
        centre: world.centre.to_array(),
        scale: world.scale,
        triangles: mesh.triangles.len() as u64,
        dropped_faces: dropped_faces as u64,
        defects: stats.defects,
        simplified: None,
        scans: Vec::new(),
    };
    Ok((record, world.mesh, stats.kept))
}

pub(super) fn failure(entry: &MeshEntry, error: &MeshError) -> MeshFailure {
    let (line, cause) = match error {
        MeshError::Malformed { line, cause, .. } => {
            (line.map(|line| line as u64), cause.to_string())
        }
        other => (None, other.to_string()),
    };
    failed(entry, line, cause)
}

pub(super) fn failed(entry: &MeshEntry, line: Option<u64>, cause: String) -> MeshFailure {
    MeshFailure { entry: entry.into(), source: entry.relative.clone(), line, cause }
}

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
    /// Bytes of the clouds that are kept for packing.
    pub kept: &'a AtomicUsize,
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
    let Prepared { mut record, views, jobs, materials } = prepared;
    for ((planned, job), cast) in views.iter().zip(&jobs).zip(casts) {
        let hits = output.progress.time(Stage::Resolve, || {
            resolve(job, cast, &output.patterns[planned.set], output.cast_effects)
        });
        output.progress.rays_decided_in_f64.fetch_add(hits.decided_in_f64 as u64, Relaxed);
        let scan = write_view(output, &record, planned, job, &hits, materials.as_ref())?;
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
    materials: Option<&Materials>,
) -> Result<ScanRecord, DatasetError> {
    let config = output.config;
    let set = &config.sets[planned.set];
    let objects = [ObjectHits::alone(job, hits, materials)];
    let mut variants = Vec::new();
    for &variant in &config.variants {
        let mut request = planned.request(config, output.patterns, &record.entry.id());
        request.effects = Some(config.effects_of(set, variant)?);
        request.attributes = config.attributes.clone();
        let (scan, tally) = output
            .progress
            .time(Stage::Resolve, || assemble(&request, output.cast_effects, &objects))?;
        output.progress.scans.fetch_add(1, Relaxed);
        output.progress.points.fetch_add(tally.points, Relaxed);
        let (entry, view) = (&record.entry, planned.view);
        let write = |&format: &ScanFormat| -> Result<FileRecord, DatasetError> {
            let path = layout::scan(output.out, &set.name, variant, entry, view, format);
            let hash = match format {
                ScanFormat::Pcap => write_packets(output, &path, &request, &objects)?,
                _ => write_scan(&path, format, config.hash, &scan)?,
            };
            Ok(FileRecord { format, hash })
        };
        let files = output
            .progress
            .time(Stage::Write, || config.formats.iter().map(write).collect::<Result<_, _>>())?;
        let source = Source { set, variant, entry, view };
        let cloud = Cloud::keep(output.kept, config, source, &scan);
        variants.push(VariantRecord { variant, tally, files, cloud });
    }
    Ok(ScanRecord { set: set.name.clone(), view: planned.view, variants })
}

/// Writes the packets of one view, whatever attributes its points have.
fn write_packets(
    output: &Output,
    path: &Path,
    request: &ScanRequest,
    objects: &[ObjectHits],
) -> Result<Option<FileHash>, DatasetError> {
    let revolution = packets::revolution(request.sensor)?;
    let effects = request.applied_effects(output.cast_effects)?;
    let mut request = request.clone();
    request.attributes = packets::attributes(&effects, &request.attributes);
    let (scan, _) = assemble(&request, output.cast_effects, objects)?;
    let DatasetConfig { hash, returns, .. } = *output.config;
    Ok(vlp32c::write(path, hash, &revolution, returns, &scan)?)
}
