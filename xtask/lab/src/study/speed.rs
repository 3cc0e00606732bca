//! How fast rays are traced.

use crate::measure::backends::{Backend, short};
use crate::measure::bench_mesh::{BenchMesh, in_a_room, target};
use crate::measure::clock::{Costs, Spread, Workload, interleave, workload};
use crate::measure::ray_set::{RaySet, sweep_pose, vlp32c};
use crate::table::{Column, Table, digits, millions_per_s};
use anyhow::Result;
use serde::Serialize;
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::{CastJob, Culling};
use sim_gpu::internals::ray::MISS;

#[derive(Serialize)]
pub struct Trace {
    mesh: String,
    triangles: usize,
    rays_from: &'static str,
    adapter: String,
    /// Rays cast in each repeat: upload, tracing and read-back.
    rays: usize,
    /// Rays that the repeat stands for: more where culling spared some.
    beams: usize,
    hits: usize,
    costs: Costs,
    /// Seconds of the kernel alone in each repeat, by the adapter's clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    kernel_s: Option<Vec<f64>>,
}

#[derive(Serialize, Default)]
pub struct Speed {
    traces: Vec<Trace>,
}

pub fn tracing(bench_meshes: &[BenchMesh], backends: &[Backend], rounds: usize) -> Result<Speed> {
    let mut speed = Speed::default();
    let pattern = vlp32c().pattern();
    let pose = sweep_pose();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        let object = target(bench_mesh.mesh.clone());
        let room = target(in_a_room(bench_mesh.mesh.clone()));
        for (rays_from, ray_set) in [
            ("sweep, all hit", RaySet::sweep(&room, &pose, &pattern, Culling::Off)),
            ("sweep, object", RaySet::sweep(&object, &pose, &pattern, Culling::On)),
            ("incoherent", RaySet::incoherent(&object, pattern.len())),
        ] {
            let rays = (rays_from, &ray_set, pattern.len());
            speed.traces.extend(traces(bench_mesh, rays, backends, rounds)?);
        }
    }
    Ok(speed)
}

fn traces(
    bench_mesh: &BenchMesh,
    (rays_from, ray_set, beams): (&'static str, &RaySet, usize),
    backends: &[Backend],
    rounds: usize,
) -> Result<Vec<Trace>> {
    let job = &ray_set.job;
    let cast = sim_gpu::internals::cpu::trace::cast(job, &Effects::default());
    let hits = cast.codes.iter().filter(|&&code| code != MISS).count();
    let fitting = |backend: &&Backend| {
        let fits = backend.caster.fits(&job.target);
        if !fits {
            eprintln!("{}: {} exceeds its bindings", backend.name(), bench_mesh.name);
        }
        fits
    };
    let backends: Vec<&Backend> = backends.iter().filter(fitting).collect();
    let copies = |backend: &Backend| backend.rays.div_ceil(job.beams.len().max(1));
    let copied = |backend: &Backend| vec![job.clone(); copies(backend)];
    let mut workloads: Vec<Workload<'_>> =
        backends.iter().map(|backend| casting(backend, copied(backend))).collect();
    let costs = interleave(rounds, &mut workloads)?;
    let trace = |(backend, costs): (&&Backend, Costs)| {
        Ok(Trace {
            mesh: bench_mesh.name.clone(),
            triangles: job.target.surface.len(),
            rays_from,
            adapter: backend.name().to_owned(),
            rays: copies(backend) * job.beams.len(),
            beams: copies(backend) * beams,
            hits: copies(backend) * hits,
            costs,
            kernel_s: kernel_seconds(backend, &copied(backend), rounds)?,
        })
    };
    backends.iter().zip(costs).map(trace).collect()
}

/// Seconds of the kernel alone in each of `repeats` casts of `jobs`, by the adapter's own
/// clock; `None` if the adapter does not have one.
fn kernel_seconds(backend: &Backend, jobs: &[CastJob], repeats: usize) -> Result<Option<Vec<f64>>> {
    let OpenCaster::Gpu(gpu) = &backend.caster else { return Ok(None) };
    // The first cast warms up and is left out.
    gpu.cast_timed(jobs)?;
    (0..repeats).map(|_| Ok(gpu.cast_timed(jobs)?.1)).collect()
}

pub fn casting(backend: &Backend, jobs: Vec<CastJob>) -> Workload<'_> {
    workload(move || Ok(backend.caster.cast(&jobs)?))
}

impl Speed {
    pub fn table(&self) -> Table {
        let kernel = |trace: &Trace| {
            let seconds = trace.kernel_s.as_ref()?.iter().copied();
            Some(millions_per_s(trace.rays, Spread::of(seconds).median))
        };
        let of_trace: [Column<Trace>; 11] = [
            ("mesh", &|trace| trace.mesh.clone()),
            ("rays", &|trace| trace.rays_from.to_owned()),
            ("adapter", &|trace| short(&trace.adapter)),
            ("batch", &|trace| trace.rays.to_string()),
            ("hits %", &|trace| digits(100.0 * trace.hits as f64 / trace.rays.max(1) as f64)),
            ("per CPU-s", &|trace| millions_per_s(trace.rays, trace.costs.cpu_s().median)),
            ("min", &|trace| millions_per_s(trace.rays, trace.costs.cpu_s().max)),
            ("max", &|trace| millions_per_s(trace.rays, trace.costs.cpu_s().min)),
            ("per wall s", &|trace| millions_per_s(trace.rays, trace.costs.wall_s().median)),
            ("beams per CPU-s", &|trace| millions_per_s(trace.beams, trace.costs.cpu_s().median)),
            ("kernel alone", &|trace| kernel(trace).unwrap_or_else(|| "-".to_owned())),
        ];
        let tracing = "Tracing, million rays a second (upload and read-back included; beams \
                       count those that culling spared)";
        Table::of(tracing, &self.traces, &of_trace)
    }
}
