//! What `--simplify auto` saves, what it costs and what it moves.

mod moved;

use crate::measure::backends::Backend;
use crate::measure::backends::short;
use crate::measure::bench_mesh::BenchMesh;
use crate::measure::clock::{Costs, Workload, interleave, measured};
use crate::measure::ray_set::RaySet;
use crate::measure::ray_set::vlp32c;
use crate::render::table::{Table, digits, milliseconds};
use crate::study::casting::speed::casting;
use anyhow::Result;
use glam::DVec3;
use moved::Moved;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::{Mesh, validate};
use sim_gpu::pose::Pose;
use sim_gpu::sensor::{Sensor, Views};
use sim_gpu::simplify::{Viewpoint, resolved_m, simplified};
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;

/// One mesh as it is and as `--simplify auto` has it.
#[derive(Serialize)]
pub struct SimplifiedMesh {
    mesh: String,
    triangles: usize,
    triangles_left: usize,
    bound_m: f64,
    /// Decimation and the proof of its bound.
    simplify: Costs,
    /// By SAH, as scenes do: of the mesh as it is, and of what is left.
    build: [Costs; 2],
    traces: Vec<Traced>,
    moved: Moved,
}

/// One caster on both.
#[derive(Serialize)]
struct Traced {
    adapter: String,
    rays: usize,
    trace: [Costs; 2],
}

/// All meshes.
#[derive(Serialize)]
pub struct Simplified(Vec<SimplifiedMesh>);

/// Measures `bench_meshes` on `backends` in `rounds` rounds each, seen as
/// `gen-dataset` sees them with the VLP-32C.
///
/// # Errors
/// If this build cannot simplify or an adapter fails.
pub fn measure(
    bench_meshes: &[BenchMesh],
    backends: &[Backend],
    rounds: usize,
) -> Result<Simplified> {
    let measured = bench_meshes.iter().map(|bench_mesh| {
        eprintln!("{}", bench_mesh.name);
        on(bench_mesh, backends, rounds)
    });
    Ok(Simplified(measured.collect::<Result<_>>()?))
}

fn on(bench_mesh: &BenchMesh, backends: &[Backend], rounds: usize) -> Result<SimplifiedMesh> {
    let sensor = Sensor::builtin("vlp32c").expect("invariant: this profile is built in");
    let views = Views::ROTATING.poses(DVec3::ZERO, formats::rng::StreamKey::new(0, "views", 0));
    let positions = views.iter().map(|view| view.position_m).collect();
    let bound_m = resolved_m(&bench_mesh.mesh, 1.0, &[Viewpoint { sensor: &sensor, positions }]);

    let kept = validate::triangle_stats(&bench_mesh.mesh).kept;
    let fewer =
        simplified(&bench_mesh.mesh, &kept, bound_m)?.unwrap_or_else(|| bench_mesh.mesh.clone());
    let surfaces = [&bench_mesh.mesh, &fewer].map(surface);
    let targets = surfaces.each_ref().map(|surface| Target::new(surface.clone(), Builder::Sah));
    let ray_sets = targets.each_ref().map(|target| ray_sets(target, &views));

    let mut workloads: Vec<Workload<'_>> = vec![simplifying(&bench_mesh.mesh, &kept, bound_m)];
    workloads.extend(surfaces.iter().map(building));
    let backends: Vec<&Backend> =
        backends.iter().filter(|backend| backend.caster.fits(&targets[0])).collect();
    let jobs = ray_sets
        .each_ref()
        .map(|ray_sets| ray_sets.iter().map(|ray_set| ray_set.job.clone()).collect());
    let jobs: [Vec<CastJob>; 2] = jobs;
    for backend in &backends {
        workloads.extend(jobs.iter().map(|jobs| casting(backend, jobs.clone())));
    }
    let mut costs = interleave(rounds, &mut workloads)?.into_iter();
    let mut next = || costs.next().unwrap_or_default();
    let (simplify, build) = (next(), [next(), next()]);
    let rays = jobs[0].iter().map(|job| job.rays.len()).sum();
    let traces = backends.iter().map(|backend| Traced {
        adapter: backend.name().to_owned(),
        rays,
        trace: [next(), next()],
    });
    Ok(SimplifiedMesh {
        mesh: bench_mesh.name.clone(),
        triangles: surfaces[0].len(),
        triangles_left: surfaces[1].len(),
        bound_m,
        simplify,
        build,
        traces: traces.collect(),
        moved: Moved::of(&ray_sets, bound_m),
    })
}

fn surface(mesh: &Mesh) -> Surface {
    Surface::new(mesh.clone(), validate::triangle_stats(mesh).kept)
}

fn ray_sets(target: &Target, views: &[Pose]) -> Vec<RaySet> {
    let pattern = vlp32c();
    views.iter().map(|pose| RaySet::sweep(target, pose, &pattern, Culling::Off)).collect()
}

fn simplifying<'a>(mesh: &'a Mesh, kept: &'a [u32], bound_m: f64) -> Workload<'a> {
    Box::new(move || {
        let (fewer, cost) = measured(|| simplified(mesh, kept, bound_m));
        black_box(fewer?);
        Ok(cost)
    })
}

fn building(surface: &Surface) -> Workload<'_> {
    Box::new(move || {
        let surface = surface.clone();
        let (built, cost) = measured(|| Target::new(surface, Builder::Sah));
        black_box(built);
        Ok(cost)
    })
}

impl Simplified {
    /// The figures for people.
    pub fn tables(&self) -> [Table; 2] {
        [self.cost_table(), self.moved_table()]
    }

    fn cost_table(&self) -> Table {
        let mut table = Table::new(
            "--simplify auto, CPU ms: as it is -> simplified (VLP-32C, 4 revolutions from 3 m, \
             no culling; SAH)",
            &[
                "mesh",
                "triangles",
                "left",
                "adapter",
                "build",
                "trace",
                "both faster",
                "simplify itself",
                "all three",
            ],
        );
        for bench_mesh in &self.0 {
            for Traced { adapter, trace, .. } in &bench_mesh.traces {
                let cpu_s = |costs: &Costs| costs.cpu_s().median;
                let [build, fewer_build] = bench_mesh.build.each_ref().map(cpu_s);
                let [trace, fewer_trace] = trace.each_ref().map(cpu_s);
                let simplify = cpu_s(&bench_mesh.simplify);
                let (before, after) = (build + trace, fewer_build + fewer_trace);
                let arrow = |p: f64, q: f64| format!("{} -> {}", milliseconds(p), milliseconds(q));
                table.push(vec![
                    bench_mesh.mesh.clone(),
                    bench_mesh.triangles.to_string(),
                    bench_mesh.triangles_left.to_string(),
                    short(adapter),
                    arrow(build, fewer_build),
                    arrow(trace, fewer_trace),
                    format!("{}x", digits(before / after)),
                    milliseconds(simplify),
                    format!("{}x", digits(before / (simplify + after))),
                ]);
            }
        }
        table
    }

    fn moved_table(&self) -> Table {
        let mut table = Table::new(
            "What it moves: points of the simplified scan against the mesh as it is, mm; range \
             errors of beams without width",
            &[
                "mesh",
                "hits",
                "bound",
                "farthest",
                "range median",
                "99 %",
                "within bound/cos %",
                "other hit or miss %",
            ],
        );
        for SimplifiedMesh { mesh, bound_m, moved, .. } in &self.0 {
            let mm = |metres: f64| digits(1e3 * metres);
            let percent = |n: usize| digits(100.0 * n as f64 / moved.hits.max(1) as f64);
            table.push(vec![
                mesh.clone(),
                moved.hits.to_string(),
                mm(*bound_m),
                mm(moved.farthest_m),
                mm(moved.median_m),
                mm(moved.most_m),
                percent(moved.within_oblique),
                percent(moved.hit_by_one),
            ]);
        }
        table
    }
}
