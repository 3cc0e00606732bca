//! One mesh: from its file to the rays that are cast at it, and from the answers of the caster to
//! its scans on disk.

use crate::clouds::Source;
use crate::config::{DatasetConfig, SetConfig, Viewpoints};
use crate::error::DatasetError;
use crate::layout;
use crate::plan::Plan;
use crate::progress::{Progress, Stage};
use crate::record::{Cloud, FileRecord, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
use crate::view::{self, Rig, View};
use formats::hash::Hashing;
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c;
use glam::{DAffine3, DVec3};
use sim_gpu::Scene;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::material::{Material, MaterialChoice, MaterialError, Materials};
use sim_gpu::internals::mesh::frame::{Normalize, Unit, Up, to_world};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::mesh::validate::triangle_stats;
use sim_gpu::internals::mesh::{LoadedMesh, NO_AREA, TriangleMesh};
use sim_gpu::internals::ray::RayFrame;
use sim_gpu::internals::scan::ObjectHits;
use sim_gpu::internals::simplify::{Simplified, Viewpoint, resolved_m, simplified_surface};
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
    let (mut record, mesh, kept) = progress.time(Stage::Read, || {
        read(entry, config.up, config.units, config.normalize, config.hash)
    })?;
    let materials = materials(entry, config)?;
    warnings(&record, materials.as_ref()).for_each(|warning| progress.note(warning));
    let id = record.entry.id();
    let centre = DVec3::from_array(record.views_around);
    let views = run.rig.views(&id, centre);
    let surface = match config.simplify {
        None => Surface::new(mesh, kept),
        Some(simplify) => {
            let bound_m =
                simplify.bound_m(|| resolved_m(&mesh, 1.0, &viewpoints(config, &id, centre)));
            let surface = progress
                .time(Stage::Build, || simplified_surface(mesh, kept, bound_m))
                .map_err(|error| MeshFailure::new(entry, error))?;
            record.simplified = Some(Simplified { bound_m, triangles: surface.len() as u64 });
            surface
        }
    };
    let rays_of = |view: &View| {
        let frame = RayFrame::new(&surface, &DAffine3::from_translation(centre), view.pose());
        view.pattern().within(&frame.cone(view.pattern())).len()
    };
    let builder = Builder::for_rays(surface.len(), views.iter().map(rays_of).sum());
    let target = progress.time(Stage::Build, || Target::new(surface, builder));
    let scene = view::scene(config, target, centre, materials);
    let sensors_m: Vec<DVec3> = views.iter().map(|view| view.pose().position_m).collect();
    doubts(&record.source, config, &scene, &sensors_m).for_each(|doubt| progress.note(doubt));
    let placed = view::placed(&scene);
    let jobs: Vec<CastJob> =
        progress.time(Stage::Aim, || views.iter().map(|view| view.aim(&placed)).collect());
    let cast: usize = jobs.iter().map(|job| job.beams.len()).sum();
    let beams: usize = views.iter().map(|view| view.pattern().len()).sum();
    progress.rays_cast.fetch_add(cast as u64, Relaxed);
    progress.rays_culled.fetch_add((beams - cast) as u64, Relaxed);
    Ok(Prepared { record, views, jobs, scene })
}

/// What is probably wrong with the unit of a mesh, with the effects or with the place of a sensor.
pub(crate) fn doubts(
    source: &str,
    config: &DatasetConfig,
    scene: &Scene,
    sensors_m: &[DVec3],
) -> impl Iterator<Item = String> {
    let mesh = scene.instances().first().map(|instance| &instance.mesh);
    let is_scaled = config.normalize != Normalize::None;
    let size = mesh
        .filter(|_| !is_scaled)
        .and_then(|mesh| mesh.extent().doubtful_size(config.units))
        .map(|doubt| format!("{doubt}; --units names another unit"));
    let inside = mesh.is_some_and(|mesh| mesh.extent().surrounds(sensors_m)).then(|| {
        let units = if is_scaled { "" } else { ", or another of --units" };
        let is_posed = |set: &SetConfig| matches!(set.viewpoints, Viewpoints::Poses(_));
        let place = match config.sets.iter().any(is_posed) {
            true => "poses outside of it",
            false => "a larger --distance",
        };
        format!("a sensor stands inside its bounding box: expected {place}{units}")
    });
    let effects = mesh.and_then(|mesh| mesh.extent().doubtful_effects(&config.effects));
    size.into_iter().chain(effects).chain(inside).map(move |doubt| format!("{source}: {doubt}"))
}

/// What is doubtful about the files of a mesh, for the user.
pub(crate) fn warnings<'a>(
    record: &'a MeshRecord,
    materials: Option<&'a Materials>,
) -> impl Iterator<Item = String> + 'a {
    let all = record.warnings.iter().chain(materials.into_iter().flat_map(|m| &m.warnings));
    all.map(|warning| format!("warning: {}: {warning}", record.source))
}

pub(crate) fn materials(
    entry: &MeshEntry,
    config: &DatasetConfig,
) -> Result<Option<Materials>, MeshFailure> {
    let otherwise = Material::diffuse(config.reflectivity);
    let choice = MaterialChoice { colours: config.colours, ..MaterialChoice::default() };
    let load = || Materials::load(&entry.path, &choice, otherwise);
    config.colours.map(|_| load()).transpose().map_err(|error| match error {
        MaterialError::Mesh(error) => MeshFailure::unreadable(entry, &error),
        other => MeshFailure::new(entry, other),
    })
}

/// Where the sensor of each set stands, from the `centre` of the mesh `id`.
fn viewpoints<'a>(config: &'a DatasetConfig, id: &str, centre: DVec3) -> Vec<Viewpoint<'a>> {
    let viewpoint = |set: &'a SetConfig| {
        let poses = set.poses(config.seed, id, centre);
        let positions = poses.iter().map(|pose| pose.position_m - centre).collect();
        Viewpoint { sensor: set.sensor.profile(), positions }
    };
    config.sets.iter().map(viewpoint).collect()
}

/// Reads the mesh of `entry`; returns its record without scans, the mesh around the origin and the
/// triangles that a ray can meet. The mesh stands where the record's `views_around` says.
pub(crate) fn read(
    entry: &MeshEntry,
    up: Option<Up>,
    unit: Unit,
    normalize: Normalize,
    hashing: Hashing,
) -> Result<(MeshRecord, TriangleMesh, Vec<u32>), MeshFailure> {
    let (loaded, hash) =
        entry.load(hashing).map_err(|error| MeshFailure::unreadable(entry, &error))?;
    let LoadedMesh { mesh, format, dropped_faces, warnings } = loaded;
    let up = up.unwrap_or(format.default_up());
    let mesh = mesh.in_metres(unit);
    let world = to_world(&mesh, up, normalize);
    let stats = triangle_stats(&world.mesh);
    if stats.kept.is_empty() {
        return Err(MeshFailure::new(entry, NO_AREA));
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
        simplified: None,
        scans: Vec::new(),
        warnings,
    };
    Ok((record, world.mesh, stats.kept))
}

/// Writes every scan of one mesh; returns its complete record.
pub(crate) fn write(
    run: &Run,
    prepared: Prepared,
    casts: &[Cast],
) -> Result<MeshRecord, DatasetError> {
    let Prepared { mut record, views, jobs, scene } = prepared;
    let placed = view::placed(&scene);
    for ((view, job), cast) in views.iter().zip(&jobs).zip(casts) {
        let hits = run.progress.time(Stage::Resolve, || view.resolve(job, cast));
        run.progress.rays_decided_in_f64.fetch_add(hits.decided_in_f64 as u64, Relaxed);
        let scan = write_view(run, &record, view, &ObjectHits::new(0, &placed, job, &hits))?;
        record.scans.push(scan);
    }
    Ok(record)
}

fn write_view(
    run: &Run,
    record: &MeshRecord,
    view: &View,
    hits: &ObjectHits,
) -> Result<ScanRecord, DatasetError> {
    let Run { plan: Plan { out, config, .. }, progress, .. } = run;
    let (set, entry) = (view.set, &record.entry);
    let mut variants = Vec::new();
    for &variant in &config.variants {
        let (scan, tally) = progress.time(Stage::Resolve, || view.scan(variant, hits))?;
        progress.scans.fetch_add(1, Relaxed);
        progress.points.fetch_add(tally.points, Relaxed);
        let write = |&format: &ScanFormat| -> Result<FileRecord, DatasetError> {
            let path = layout::scan(out, &set.name, variant, entry, view.number, format);
            let hash = match format {
                ScanFormat::Pcap => {
                    let (scan, revolution) = view.packets(variant, hits)?;
                    vlp32c::write(&path, config.hash, &revolution, config.returns, &scan)?
                }
                _ => write_scan(&path, format, config.hash, &scan)?,
            };
            Ok(FileRecord { format, hash })
        };
        let files = progress
            .time(Stage::Write, || config.formats.iter().map(write).collect::<Result<_, _>>())?;
        let source = Source { set, variant, entry, view: view.number };
        let cloud = Cloud::keep(&run.kept, config, source, &scan);
        variants.push(VariantRecord { variant, tally, files, cloud });
    }
    Ok(ScanRecord { set: set.name.clone(), view: view.number, variants })
}
