//! How fast hierarchies are built and rays are traced.

use crate::measure::backends::{Backend, short};
use crate::measure::bench_mesh::{BenchMesh, target};
use crate::measure::clock::{Cost, Costs, Spread, Workload, interleave, measured};
use crate::measure::ray_set::{RaySet, sweep_pose, vlp32c};
use crate::measure::scenes::in_a_room;
use crate::render::table::{Table, digits, millions_per_s, milliseconds};
use anyhow::Result;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::validate;
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;

/// One builder on one mesh.
#[derive(Serialize)]
pub struct Build {
    mesh: String,
    triangles: usize,
    builder: String,
    costs: Costs,
}

/// One caster on one set of rays.
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
    /// Rays that hit.
    hits: usize,
    costs: Costs,
    /// Seconds of the kernel alone in each repeat, by the adapter's clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    kernel_s: Option<Vec<f64>>,
}

/// All speeds of a run.
#[derive(Serialize, Default)]
pub struct Speed {
    builds: Vec<Build>,
    traces: Vec<Trace>,
}

/// Measures `bench_meshes` on `backends` in `rounds` rounds each.
///
/// # Errors
/// If an adapter fails.
pub fn measure(bench_meshes: &[BenchMesh], backends: &[Backend], rounds: usize) -> Result<Speed> {
    let mut speed = Speed::default();
    let pattern = vlp32c();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        builds(bench_mesh, rounds, &mut speed)?;
        let object = target(bench_mesh.mesh.clone(), Builder::Sah);
        let room = target(in_a_room(bench_mesh.mesh.clone()), Builder::Sah);
        let pose = sweep_pose()?;
        for (name, ray_set, beams) in [
            ("sweep, all hit", RaySet::sweep(&room, &pose, &pattern, Culling::Off), pattern.len()),
            ("sweep, object", RaySet::sweep(&object, &pose, &pattern, Culling::On), pattern.len()),
            ("incoherent", RaySet::incoherent(&object, pattern.len()), pattern.len()),
        ] {
            traces(bench_mesh, (name, &ray_set, beams), backends, rounds, &mut speed)?;
        }
    }
    Ok(speed)
}

fn builds(bench_mesh: &BenchMesh, rounds: usize, speed: &mut Speed) -> Result<()> {
    let kept = validate::triangle_stats(&bench_mesh.mesh).kept;
    let triangles = kept.len();
    let surface = Surface::new(bench_mesh.mesh.clone(), kept);
    let builders = [Builder::Sah, Builder::Morton];
    let mut workloads: Vec<Workload<'_>> = builders
        .iter()
        .map(|&builder| {
            let surface = &surface;
            let workload: Workload<'_> = Box::new(move || {
                let surface = surface.clone();
                let (built, cost) = measured(|| Target::new(surface, builder));
                black_box(built);
                Ok(cost)
            });
            workload
        })
        .collect();
    for (costs, builder) in interleave(rounds, &mut workloads)?.into_iter().zip(builders) {
        let (mesh, builder) = (bench_mesh.name.clone(), format!("{builder:?}"));
        speed.builds.push(Build { mesh, triangles, builder, costs });
    }
    Ok(())
}

fn traces(
    bench_mesh: &BenchMesh,
    (rays_from, ray_set, beams): (&'static str, &RaySet, usize),
    backends: &[Backend],
    rounds: usize,
    speed: &mut Speed,
) -> Result<()> {
    let cast = sim_gpu::cpu::trace::cast(&ray_set.job, &sim_gpu::effects::Effects::default());
    let hits = cast.codes.iter().filter(|&&code| code != sim_gpu::ray::MISS).count();
    let fitting = |backend: &&Backend| {
        let fits = backend.caster.fits(&ray_set.job.target);
        if !fits {
            eprintln!("{}: {} exceeds its bindings", backend.name(), bench_mesh.name);
        }
        fits
    };
    let backends: Vec<&Backend> = backends.iter().filter(fitting).collect();
    let copies = |backend: &Backend| backend.rays.div_ceil(ray_set.job.rays.len().max(1));
    let mut workloads: Vec<Workload<'_>> = backends
        .iter()
        .map(|backend| casting(backend, vec![ray_set.job.clone(); copies(backend)]))
        .collect();
    let costs = interleave(rounds, &mut workloads)?;
    for (backend, costs) in backends.iter().zip(costs) {
        speed.traces.push(Trace {
            mesh: bench_mesh.name.clone(),
            triangles: ray_set.job.target.surface.len(),
            rays_from,
            adapter: backend.name().to_owned(),
            rays: copies(backend) * ray_set.job.rays.len(),
            beams: copies(backend) * beams,
            hits: copies(backend) * hits,
            costs,
            kernel_s: kernel_seconds(backend, &ray_set.job, copies(backend), rounds)?,
        });
    }
    Ok(())
}

/// Seconds of the kernel alone in each of `repeats` casts of `copies` copies of `job`, by
/// the adapter's own clock; `None` if the adapter does not have one.
fn kernel_seconds(
    backend: &Backend,
    job: &CastJob,
    copies: usize,
    repeats: usize,
) -> Result<Option<Vec<f64>>> {
    let Caster::Gpu(gpu) = &backend.caster else { return Ok(None) };
    let jobs = vec![job.clone(); copies];
    // The first cast warms up and is left out.
    gpu.cast_timed(&jobs)?;
    (0..repeats).map(|_| Ok(gpu.cast_timed(&jobs)?.1)).collect()
}

/// Casts `jobs` on `backend`, all together.
pub fn casting<'a>(backend: &'a Backend, jobs: Vec<CastJob>) -> Workload<'a> {
    Box::new(move || {
        let (casts, cost): (_, Cost) = measured(|| backend.caster.cast(&jobs));
        black_box(casts?);
        Ok(cost)
    })
}

impl Speed {
    /// The figures for people.
    pub fn tables(&self) -> [Table; 2] {
        let mut builds = Table::new(
            "Building the hierarchy",
            &["mesh", "triangles", "builder", "CPU ms", "min", "max", "wall ms", "M tri/CPU-s"],
        );
        for build in &self.builds {
            let (cpu, wall) = (build.costs.cpu_s(), build.costs.wall_s());
            builds.push(vec![
                build.mesh.clone(),
                build.triangles.to_string(),
                build.builder.clone(),
                milliseconds(cpu.median),
                milliseconds(cpu.min),
                milliseconds(cpu.max),
                milliseconds(wall.median),
                millions_per_s(build.triangles, cpu.median),
            ]);
        }
        [builds, self.trace_table()]
    }

    fn trace_table(&self) -> Table {
        let mut traces = Table::new(
            "Tracing, million rays a second (upload and read-back included; \
             beams count those that culling spared)",
            &[
                "mesh",
                "rays",
                "adapter",
                "batch",
                "hits %",
                "per CPU-s",
                "min",
                "max",
                "per wall s",
                "beams per CPU-s",
                "kernel alone",
            ],
        );
        for trace in &self.traces {
            let (cpu, wall) = (trace.costs.cpu_s(), trace.costs.wall_s());
            traces.push(vec![
                trace.mesh.clone(),
                trace.rays_from.to_owned(),
                short(&trace.adapter),
                trace.rays.to_string(),
                digits(100.0 * trace.hits as f64 / trace.rays.max(1) as f64),
                millions_per_s(trace.rays, cpu.median),
                millions_per_s(trace.rays, cpu.max),
                millions_per_s(trace.rays, cpu.min),
                millions_per_s(trace.rays, wall.median),
                millions_per_s(trace.beams, cpu.median),
                match &trace.kernel_s {
                    Some(seconds) => {
                        millions_per_s(trace.rays, Spread::of(seconds.iter().copied()).median)
                    }
                    None => "-".to_owned(),
                },
            ]);
        }
        traces
    }
}
