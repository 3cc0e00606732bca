//! Where the time goes between a mesh file and its ranges: the scans of the
//! default set, stage by stage.
//!
//! Each stage does all meshes before the next begins, so that its CPU time can
//! be told apart; a real run does all stages at once on all cores, and writes.

use super::clock::{Cost, Costs, measured};
use super::lanes::Lane;
use super::speed::short;
use super::table::{Table, digits, milliseconds};
use anyhow::{Context, Result};
use formats::rng::StreamKey;
use glam::{DAffine3, DVec3};
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::{LoadedMesh, census, load, tree};
use sim_gpu::pose::Pose;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::resolve;
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The stages, in order.
const STAGES: [&str; 8] =
    ["read", "to world", "survey", "surface", "count rays", "tree + aim", "cast", "ranges"];

/// The default set on one adapter.
#[derive(Serialize)]
pub struct Pipeline {
    adapter: String,
    meshes: usize,
    scans: usize,
    rays: usize,
    points: usize,
    /// The stages' names and costs, in order.
    stages: Vec<(&'static str, Costs)>,
}

/// A sensor's beams and where it stands.
struct Set {
    pattern: BeamPattern,
    poses: Vec<Pose>,
}

/// Runs the stages over at most `limit` of the meshes under `root`, on each of
/// `lanes`.
///
/// # Errors
/// If a mesh cannot be read or an adapter fails.
pub fn measure(root: &Path, limit: usize, lanes: &[Lane], rounds: usize) -> Result<Vec<Pipeline>> {
    let entries = tree::discover(root, 0)?;
    let taken = limit.clamp(1, entries.len());
    let chosen = (0..taken).map(|k| &entries[k * entries.len() / taken]);
    // What cannot be read is the reader's to report, not the stopwatch's.
    let paths: Vec<PathBuf> =
        chosen.map(|entry| entry.path.clone()).filter(|path| load(path).is_ok()).collect();
    let sets = default_sets();
    let mut pipelines: Vec<Pipeline> = lanes
        .iter()
        .map(|lane| Pipeline {
            adapter: lane.name().to_owned(),
            meshes: paths.len(),
            scans: 0,
            rays: 0,
            points: 0,
            stages: STAGES.map(|stage| (stage, Costs::default())).to_vec(),
        })
        .collect();
    for round in 0..=rounds {
        for (lane, pipeline) in lanes.iter().zip(&mut pipelines) {
            let costs = pipeline.run(&paths, &sets, lane)?;
            if round > 0 {
                pipeline.stages.iter_mut().zip(costs).for_each(|((_, all), cost)| all.0.push(cost));
            }
        }
    }
    Ok(pipelines)
}

/// The two sensors of the default set at their default views.
fn default_sets() -> Vec<Set> {
    ["vlp32c", "generic-static"]
        .map(|name| {
            let sensor = Sensor::builtin(name).expect("invariant: this profile is built in");
            let key = StreamKey::new(0, name, 0);
            Set { pattern: sensor.pattern(), poses: sensor.default_views().poses(DVec3::ZERO, key) }
        })
        .into()
}

impl Pipeline {
    /// Does all once; what each stage cost.
    fn run(&mut self, paths: &[PathBuf], sets: &[Set], lane: &Lane) -> Result<Vec<Cost>> {
        let (loaded, read) = measured(|| -> Result<Vec<LoadedMesh>, _> {
            paths.iter().map(|path| load(path)).collect()
        });
        let loaded = loaded.context("a mesh that could be read once cannot any more")?;
        let (worlds, to_world) = each(&loaded, |loaded| {
            to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere).mesh
        });
        let (kept, survey) = each(&worlds, |mesh| census::survey(mesh).kept);
        let (surfaces, surface) =
            each(worlds.into_iter().zip(kept), |(mesh, kept)| Surface::new(mesh, kept));
        let (rays, count) = each(&surfaces, |surface| count_rays(surface, sets));
        let (jobs, aim) = each(surfaces.into_iter().zip(rays), |(surface, rays)| {
            let builder = Builder::for_rays(surface.len(), rays);
            aim(&Arc::new(Target::new(surface, builder)), sets)
        });
        let (patterns, jobs): (Vec<&BeamPattern>, Vec<CastJob>) =
            jobs.into_iter().flatten().unzip();
        let (casts, cast) = measured(|| lane.caster.cast(&jobs));
        let (points, ranges) =
            each(jobs.iter().zip(casts?).zip(patterns), |((job, cast), pattern)| {
                black_box(resolve(job, &cast, pattern, &Effects::default())).hits.len()
            });
        self.scans = jobs.len();
        self.rays = jobs.iter().map(|job| job.rays.len()).sum();
        self.points = points.iter().sum();
        Ok(vec![read, to_world, survey, surface, count, aim, cast, ranges])
    }

    /// CPU seconds of all stages.
    fn cpu_s(&self) -> f64 {
        self.stages.iter().map(|(_, costs)| costs.cpu_s().median).sum()
    }
}

fn each<A, B>(items: impl IntoIterator<Item = A>, stage: impl Fn(A) -> B) -> (Vec<B>, Cost) {
    let items: Vec<A> = items.into_iter().collect();
    measured(|| items.into_iter().map(stage).collect())
}

/// How many beams of all views may hit `surface`.
fn count_rays(surface: &Surface, sets: &[Set]) -> usize {
    let frame = |pose: &Pose| RayFrame::new(surface, &DAffine3::IDENTITY, pose);
    let of_set = |set: &Set| -> usize {
        let cones = set.poses.iter().map(|pose| frame(pose).cone(&set.pattern));
        cones.map(|cone| set.pattern.within(&cone).len()).sum()
    };
    sets.iter().map(of_set).sum()
}

/// A job for each view of `target`.
fn aim<'a>(target: &Arc<Target>, sets: &'a [Set]) -> Vec<(&'a BeamPattern, CastJob)> {
    let stream = StreamKey::new(0, "pipeline", 0);
    let views = sets.iter().flat_map(|set| set.poses.iter().map(move |pose| (set, pose)));
    let job = |(set, pose): (&'a Set, &Pose)| {
        let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, pose);
        let target = Arc::clone(target);
        (&set.pattern, CastJob::aim(target, frame, &set.pattern, Culling::On, stream, 1.0))
    };
    views.map(job).collect()
}

/// The figures for people.
pub fn table(pipelines: &[Pipeline]) -> Table {
    let mut heading = vec!["adapter", "meshes", "scans", "rays", "points"];
    heading.extend(STAGES);
    heading.extend(["CPU ms/mesh", "meshes/CPU-s"]);
    let mut table = Table::new(
        "From file to ranges, the scans of the default set: CPU ms of all meshes and share of each \
         stage",
        &heading,
    );
    for pipeline in pipelines {
        let Pipeline { adapter, meshes, scans, rays, points, stages } = pipeline;
        let total_s = pipeline.cpu_s();
        let mut row = vec![short(adapter)];
        row.extend([meshes, scans, rays, points].map(|n| n.to_string()));
        row.extend(stages.iter().map(|(_, costs)| {
            let cpu_s = costs.cpu_s().median;
            format!("{} ({:.0} %)", milliseconds(cpu_s), 100.0 * cpu_s / total_s)
        }));
        row.push(milliseconds(total_s / *meshes as f64));
        row.push(digits(*meshes as f64 / total_s));
        table.push(row);
    }
    table
}
