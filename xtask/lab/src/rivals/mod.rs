//! Embree on the same meshes and rays, in the same run.

mod embree;

use crate::measure::backends::{Backend, short};
use crate::measure::bench_mesh::{BenchMesh, in_a_room, target};
use crate::measure::clock::{Costs, Workload, interleave, workload};
use crate::measure::methods::{self, Accuracy};
use crate::measure::ray_set::{RaySet, sweep_pose, vlp32c};
use crate::study::speed::casting;
use crate::table::{Column, Table, digits, millions_per_s, milliseconds};
use anyhow::Result;
use edgepuck_mesh::TriangleMesh;
use embree::{Embree, RIVALS};
use rayon::prelude::*;
use serde::Serialize;
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::{Cast, CastJob, Culling};
use sim_gpu::internals::resolve::{Hits, resolve};
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest};
use sim_gpu::internals::target::Target;
use std::cell::RefCell;
use std::iter::{repeat, zip};
use std::slice::from_ref;
use xtask::venv::Environment;

const OPEN3D: Environment<'_> = Environment {
    name: "venv",
    requirements: "xtask/lab/peers/requirements.txt",
    size: "some 700 MB",
};

/// Revolutions that are aimed, cast and solved in one repeat.
const REVOLUTIONS: usize = 10;

#[derive(Serialize)]
struct Entry {
    mesh: String,
    triangles: usize,
    rays_from: &'static str,
    caster: String,
    rays: usize,
    costs: Costs,
    #[serde(flatten)]
    accuracy: Accuracy,
}

/// All figures, and the versions of what they were compared with.
#[derive(Serialize)]
pub struct Comparison {
    versions: serde_json::Value,
    entries: Vec<Entry>,
}

/// Compares `backends` with Embree on `bench_meshes`; `None`, with a message, where
/// Embree cannot be had.
pub fn measure(
    bench_meshes: &[BenchMesh],
    backends: &[Backend],
    rounds: usize,
) -> Result<Option<Comparison>> {
    let started = OPEN3D.interpreter().map_err(anyhow::Error::msg);
    let embree = match started.and_then(|python| Embree::start(&python)) {
        Ok(embree) => RefCell::new(embree),
        Err(cause) => {
            println!("skipped the comparison with Embree: {cause:#}");
            return Ok(None);
        }
    };
    let sensor = vlp32c();
    let pattern = sensor.pattern();
    let request = ScanRequest::new(&sensor, &pattern, sweep_pose());
    let mut entries = Vec::new();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        let bench = Bench { mesh: &bench_mesh.name, backends, rounds, embree: &embree };
        let room = bench.load(&in_a_room(bench_mesh.mesh.clone()))?;
        let sweep = RaySet::sweep(&room, &request.pose, &pattern, Culling::Off);
        entries.extend(bench.trace("sweep, all hit", &sweep)?);
        entries.extend(bench.whole("whole, all hit", &room, &request)?);
        let object = bench.load(&bench_mesh.mesh)?;
        let sweep = RaySet::sweep(&object, &request.pose, &pattern, Culling::On);
        entries.extend(bench.trace("sweep, object", &sweep)?);
        entries.extend(bench.whole("whole, object", &object, &request)?);
        let incoherent = RaySet::incoherent(&object, pattern.len());
        entries.extend(bench.trace("incoherent", &incoherent)?);
    }
    let versions = embree.into_inner().versions.clone();
    Ok(Some(Comparison { versions, entries }))
}

struct Bench<'a> {
    mesh: &'a str,
    backends: &'a [Backend],
    rounds: usize,
    embree: &'a RefCell<Embree>,
}

impl Bench<'_> {
    fn load(&self, mesh: &TriangleMesh) -> Result<Target> {
        self.embree.borrow_mut().load(mesh)?;
        Ok(target(mesh.clone()))
    }

    /// Tracing alone: the same rays, ready in memory.
    fn trace(&self, rays_from: &'static str, ray_set: &RaySet) -> Result<Vec<Entry>> {
        let most = self.backends.iter().map(|backend| backend.rays).max().unwrap_or(0);
        let copies = most.div_ceil(ray_set.rays.len().max(1));
        self.embree.borrow_mut().aim(ray_set, copies)?;
        let jobs = vec![ray_set.job.clone(); copies];
        let ours = self.backends.iter().map(|backend| casting(backend, jobs.clone())).collect();
        let ranges = |caster: &OpenCaster| -> Result<_> {
            Ok(ray_set.ranges(&caster.cast(from_ref(&ray_set.job))?.swap_remove(0)))
        };
        self.entries(rays_from, (ray_set, copies), ours, ranges)
    }

    /// From beams to ranges: Edgepuck aims, casts and solves in f64; Embree casts all rays of the
    /// revolution in f32.
    fn whole(
        &self,
        rays_from: &'static str,
        target: &Target,
        request: &ScanRequest<'_>,
    ) -> Result<Vec<Entry>> {
        let pattern = request.pattern;
        let solve = |caster: &OpenCaster, revolutions: usize| -> Result<Vec<Hits>> {
            let aim = || request.aim(&PlacedTarget::new(target));
            let resolve =
                |job: &CastJob, cast: &Cast| resolve(job, cast, pattern, &Effects::default());
            // A CPU takes one scan after another, a GPU all at once.
            if matches!(caster, OpenCaster::Cpu(_)) {
                let scan = |_| -> Result<Hits> {
                    let job = aim();
                    Ok(resolve(&job, &caster.cast(from_ref(&job))?[0]))
                };
                return (0..revolutions).into_par_iter().map(scan).collect();
            }
            let jobs: Vec<CastJob> = (0..revolutions).map(|_| aim()).collect();
            let casts = caster.cast(&jobs)?;
            Ok(jobs.iter().zip(&casts).map(|(job, cast)| resolve(job, cast)).collect())
        };
        let all = RaySet::sweep(target, &request.pose, pattern, Culling::Off);
        self.embree.borrow_mut().aim(&all, REVOLUTIONS)?;
        let ours = self.backends.iter();
        let ours = ours.map(|ours| workload(move || solve(&ours.caster, REVOLUTIONS))).collect();
        let ranges = |caster: &OpenCaster| -> Result<_> {
            let mut by_beam = vec![None; pattern.len()];
            for hit in &solve(caster, 1)?[0].hits {
                by_beam[hit.beam as usize] = Some(hit.range_m);
            }
            Ok(all.job.beams.iter().map(|&beam| by_beam[beam as usize]).collect())
        };
        self.entries(rays_from, (&all, REVOLUTIONS), ours, ranges)
    }

    /// Times `ours`, one workload for each backend, and Embree's rays, `copies` copies of
    /// `ray_set`; `ranges` are a backend's ranges of one copy.
    fn entries(
        &self,
        rays_from: &'static str,
        (ray_set, copies): (&RaySet, usize),
        ours: Vec<Workload<'_>>,
        ranges: impl Fn(&OpenCaster) -> Result<Vec<Option<f64>>>,
    ) -> Result<Vec<Entry>> {
        let mut workloads: Vec<Workload<'_>> = ours;
        for rival in RIVALS {
            workloads.push(Box::new(move || self.embree.borrow_mut().cast(rival)));
        }
        let costs = interleave(self.rounds, &mut workloads)?;
        let truth = methods::in_f64(ray_set);
        let mut answers = Vec::new();
        for backend in self.backends {
            answers.push((backend.name(), ranges(&backend.caster)?));
        }
        for rival in RIVALS {
            let ranges = self.embree.borrow_mut().ranges(rival)?.into_iter();
            let ranges = ranges.map(|t| t.is_finite().then_some(f64::from(t)));
            answers.push((rival, ranges.collect()));
        }
        let entry = |((caster, ranges), costs): ((&str, Vec<_>), Costs)| Entry {
            mesh: self.mesh.to_owned(),
            triangles: ray_set.job.target.surface.len(),
            rays_from,
            caster: caster.to_owned(),
            rays: ray_set.rays.len() * copies,
            costs,
            accuracy: Accuracy::of(&ranges, &truth),
        };
        Ok(answers.into_iter().zip(costs).map(entry).collect())
    }
}

impl Comparison {
    pub fn table(&self) -> Table {
        let same_rays = |a: &Entry, b: &Entry| a.mesh == b.mesh && a.rays_from == b.rays_from;
        let groups = self.entries.chunk_by(same_rays);
        // Embree through Open3D is the last of each group.
        let rows: Vec<(&Entry, &Entry)> =
            groups.flat_map(|group| zip(group, repeat(&group[group.len() - 1]))).collect();
        let cpu_s = |entry: &Entry| entry.costs.cpu_s().median;
        let wall_s = |entry: &Entry| entry.costs.wall_s().median;
        let mismatches = |of: &Accuracy| of.false_hits + of.misses;
        let columns: [Column<'_, (&Entry, &Entry)>; 9] = [
            ("mesh", &|(entry, _)| entry.mesh.clone()),
            ("rays", &|(entry, _)| entry.rays_from.to_owned()),
            ("caster", &|(entry, _)| short(&entry.caster)),
            ("per CPU-s", &|(entry, _)| millions_per_s(entry.rays, cpu_s(entry))),
            ("per wall s", &|(entry, _)| millions_per_s(entry.rays, wall_s(entry))),
            ("CPU ms", &|(entry, _)| milliseconds(cpu_s(entry))),
            ("x Embree", &|(entry, embree)| digits(cpu_s(embree) / cpu_s(entry))),
            ("hit mismatches", &|(entry, _)| mismatches(&entry.accuracy).to_string()),
            ("worst range error m", &|(entry, _)| digits(entry.accuracy.worst_m)),
        ];
        let title = format!(
            "Against Embree (Open3D {} and embreex {}), million rays a second; `whole` is aiming, \
             casting and solving ranges in f64, the beams that culling spares counted",
            self.versions["open3d"].as_str().unwrap_or("?"),
            self.versions["embreex"].as_str().unwrap_or("?")
        );
        Table::of(title, &rows, &columns)
    }
}
