//! How others do on the same meshes and rays, in the same run.

mod embree;

use crate::measure::accuracy::Accuracy;
use crate::measure::backends::Backend;
use crate::measure::backends::short;
use crate::measure::bench_mesh::BenchMesh;
use crate::measure::bench_mesh::target;
use crate::measure::clock::{Costs, Workload, interleave, measured};
use crate::measure::ray_set::RaySet;
use crate::measure::ray_set::{sweep_pose, vlp32c};
use crate::measure::scenes::in_a_room;
use crate::render::table::{Table, digits, millions_per_s, milliseconds};
use crate::study::casting::speed::casting;
use anyhow::Result;
use embree::Embree;
use glam::DAffine3;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::cpu::oracle;
use sim_gpu::effects::Effects;
use sim_gpu::job::{Cast, CastJob, Culling};
use sim_gpu::mesh::Mesh;
use sim_gpu::pose::Pose;
use sim_gpu::ray::{Ray, RayFrame};
use sim_gpu::resolve::resolve;
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::Target;
use std::cell::RefCell;
use std::hint::black_box;
use xtask::venv::Environment;

const OPEN3D: Environment<'_> = Environment {
    name: "venv",
    requirements: "xtask/lab/peers/requirements.txt",
    size: "some 700 MB",
};

/// Rays in the order in which we cast them: neighbours traverse alike.
const OURS: &str = "our order";

/// The same rays in the order in which the sensor fires them.
const FIRED: &str = "firing order";

/// One caster on one set of rays.
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
///
/// # Errors
/// If an adapter or the peer fails on the way.
pub fn measure(
    bench_meshes: &[BenchMesh],
    backends: &[Backend],
    rounds: usize,
) -> Result<Option<Comparison>> {
    let embree = match OPEN3D.interpreter() {
        Ok(python) => Embree::start(&python).map_err(|error| format!("{error:#}")),
        Err(cause) => Err(cause),
    };
    let embree = match embree {
        Ok(embree) => RefCell::new(embree),
        Err(cause) => {
            println!("skipped the comparison with Embree: {cause}");
            return Ok(None);
        }
    };
    let mut entries = Vec::new();
    let pattern = vlp32c();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        let room = in_a_room(bench_mesh.mesh.clone());
        for (mesh, trace, whole) in [
            (&room, "sweep, all hit", "whole, all hit"),
            (&bench_mesh.mesh, "sweep, object", "whole, object"),
        ] {
            let bench = Bench { bench_mesh, mesh, backends, rounds, embree: &embree };
            let culling = if trace == "sweep, object" { Culling::On } else { Culling::Off };
            let target = bench.load()?;
            let pose = sweep_pose()?;
            let ray_set = RaySet::sweep(&target, &pose, &pattern, culling);
            entries.extend(bench.trace(trace, &ray_set)?);
            entries.extend(bench.whole(whole, &target, &pose, &pattern)?);
        }
        let bench = Bench { bench_mesh, mesh: &bench_mesh.mesh, backends, rounds, embree: &embree };
        entries
            .extend(bench.trace("incoherent", &RaySet::incoherent(&bench.load()?, pattern.len()))?);
    }
    let versions = embree.into_inner().versions.clone();
    Ok(Some(Comparison { versions, entries }))
}

/// One mesh and who casts at it.
struct Bench<'a> {
    bench_mesh: &'a BenchMesh,
    mesh: &'a Mesh,
    backends: &'a [Backend],
    rounds: usize,
    embree: &'a RefCell<Embree>,
}

impl Bench<'_> {
    fn load(&self) -> Result<Target> {
        self.embree.borrow_mut().load(self.mesh)?;
        Ok(target(self.mesh.clone(), Builder::Sah))
    }

    /// Tracing alone: the same rays, ready in memory.
    fn trace(&self, name: &'static str, ray_set: &RaySet) -> Result<Vec<Entry>> {
        let most = self.backends.iter().map(|backend| backend.rays).max().unwrap_or(0);
        let copies = most.div_ceil(ray_set.rays.len().max(1));
        let jobs = vec![ray_set.job.clone(); copies];
        let mut workloads: Vec<Workload<'_>> =
            self.backends.iter().map(|backend| casting(backend, jobs.clone())).collect();
        self.embree.borrow_mut().aim(OURS, ray_set, copies)?;
        self.embree.borrow_mut().aim(FIRED, &ray_set.in_firing_order(), copies)?;
        workloads.push(Box::new(|| self.embree.borrow_mut().cast(FIRED)));
        workloads.push(Box::new(|| self.embree.borrow_mut().cast(OURS)));
        let costs = interleave(self.rounds, &mut workloads)?;
        let ranges = |caster: &Caster| -> Result<_> {
            let cast = caster.cast(std::slice::from_ref(&ray_set.job))?;
            Ok(ray_set.ranges(cast.first().unwrap_or(&Cast::default())))
        };
        self.entries(name, ray_set, ray_set.rays.len() * copies, costs, ranges)
    }

    /// From beams to ranges: we aim, cast and solve in f64; Embree is handed
    /// all rays of the revolution and answers in f32.
    fn whole(
        &self,
        name: &'static str,
        target: &Target,
        pose: &Pose,
        pattern: &BeamPattern,
    ) -> Result<Vec<Entry>> {
        let all = RaySet::sweep(target, pose, pattern, Culling::Off);
        let copies = 10;
        let aim = || {
            let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, pose);
            let stream = all.job.stream;
            CastJob::aim(target.clone(), frame, pattern, Culling::On, stream, 1.0)
        };
        let whole = |caster: &Caster| -> Result<()> {
            let jobs: Vec<CastJob> = (0..copies).map(|_| aim()).collect();
            for (job, cast) in jobs.iter().zip(caster.cast(&jobs)?) {
                black_box(resolve(job, &cast, pattern, &Effects::default()));
            }
            Ok(())
        };
        let mut workloads: Vec<Workload<'_>> = Vec::new();
        for backend in self.backends {
            let whole = &whole;
            workloads.push(Box::new(move || {
                let (done, cost) = measured(|| whole(&backend.caster));
                done.map(|()| cost)
            }));
        }
        self.embree.borrow_mut().aim(OURS, &all, copies)?;
        workloads.push(Box::new(|| self.embree.borrow_mut().cast(OURS)));
        let costs = interleave(self.rounds, &mut workloads)?;
        let ranges = |caster: &Caster| -> Result<_> {
            let job = aim();
            let casts = caster.cast(std::slice::from_ref(&job))?;
            let mut by_beam = vec![None; pattern.len()];
            for cast in &casts {
                for hit in resolve(&job, cast, pattern, &Effects::default()).hits {
                    by_beam[hit.beam as usize] = Some(hit.range_m);
                }
            }
            Ok(all.job.beams.iter().map(|&beam| by_beam[beam as usize]).collect())
        };
        self.entries(name, &all, all.rays.len() * copies, costs, ranges)
    }

    fn entries(
        &self,
        rays_from: &'static str,
        ray_set: &RaySet,
        rays: usize,
        costs: Vec<Costs>,
        ranges: impl Fn(&Caster) -> Result<Vec<Option<f64>>>,
    ) -> Result<Vec<Entry>> {
        let target = &ray_set.job.target;
        let nearest = |ray: &Ray| oracle::nearest(target, ray).map(|crossing| crossing.range_m);
        let truth: Vec<Option<f64>> = ray_set.rays.iter().map(nearest).collect();
        let mut answers = Vec::new();
        for backend in self.backends {
            answers.push((backend.name().to_owned(), ranges(&backend.caster)?));
        }
        let finite = |t: f32| t.is_finite().then_some(f64::from(t));
        let of_embree: Vec<Option<f64>> =
            self.embree.borrow_mut().ranges(OURS)?.into_iter().map(finite).collect();
        if costs.len() > self.backends.len() + 1 {
            // The same rays: only the time depends on their order.
            answers.push(("Embree, firing order".to_owned(), of_embree.clone()));
        }
        answers.push(("Embree".to_owned(), of_embree));
        let entry = |((caster, ranges), costs): ((String, Vec<_>), Costs)| Entry {
            mesh: self.bench_mesh.name.clone(),
            triangles: target.surface.len(),
            rays_from,
            caster,
            rays,
            costs,
            accuracy: Accuracy::of(&ranges, &truth),
        };
        Ok(answers.into_iter().zip(costs).map(entry).collect())
    }
}

impl Comparison {
    /// The figures for people.
    pub fn table(&self) -> Table {
        let mut table = Table::new(
            format!(
                "Against Embree (Open3D {}), million rays a second; `whole` is aiming, casting and \
                 solving ranges in f64, the beams that culling spares counted",
                self.versions["open3d"].as_str().unwrap_or("?")
            ),
            &[
                "mesh",
                "rays",
                "caster",
                "per CPU-s",
                "per wall s",
                "CPU ms",
                "x Embree",
                "hit mismatches",
                "worst range error m",
            ],
        );
        for group in self.entries.chunk_by(|a, b| a.mesh == b.mesh && a.rays_from == b.rays_from) {
            let Some(embree) = group.last() else { continue };
            for entry in group {
                let cpu_s = entry.costs.cpu_s().median;
                table.push(vec![
                    entry.mesh.clone(),
                    entry.rays_from.to_owned(),
                    short(&entry.caster),
                    millions_per_s(entry.rays, cpu_s),
                    millions_per_s(entry.rays, entry.costs.wall_s().median),
                    milliseconds(cpu_s),
                    digits(embree.costs.cpu_s().median / cpu_s),
                    (entry.accuracy.false_hits + entry.accuracy.misses).to_string(),
                    digits(entry.accuracy.worst_m),
                ]);
            }
        }
        table
    }
}
