//! What `--simplify auto` saves, what it costs and what it moves.

mod moved;

use super::speed::{building, casting};
use crate::measure::backends::{Backend, short};
use crate::measure::bench_mesh::BenchMesh;
use crate::measure::clock::{Costs, Workload, interleave, workload};
use crate::measure::ray_set::{RaySet, vlp32c};
use crate::render::table::{Column, Table, digits, milliseconds};
use anyhow::Result;
use glam::DVec3;
use moved::Moved;
use serde::Serialize;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::job::{CastJob, Culling};
use sim_gpu::internals::sensor::Views;
use sim_gpu::internals::simplify::{Viewpoint, resolved_m, simplified, simplified_surface};
use sim_gpu::internals::target::{Surface, Target};

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
pub fn measure(
    bench_meshes: &[BenchMesh],
    backends: &[Backend],
    rounds: usize,
) -> Result<Simplified> {
    let measured = bench_meshes.iter().map(|bench_mesh| on(bench_mesh, backends, rounds));
    Ok(Simplified(measured.collect::<Result<_>>()?))
}

fn on(bench_mesh: &BenchMesh, backends: &[Backend], rounds: usize) -> Result<SimplifiedMesh> {
    eprintln!("{}", bench_mesh.name);
    let sensor = vlp32c();
    let pattern = sensor.pattern();
    let views = Views::ROTATING.poses(DVec3::ZERO, formats::rng::StreamKey::new(0, "views", 0));
    let positions = views.iter().map(|view| view.position_m).collect();
    let mesh = &bench_mesh.mesh;
    let bound_m = resolved_m(mesh, 1.0, &[Viewpoint { sensor: &sensor, positions }]);

    let whole = Surface::of_mesh(mesh.clone());
    let fewer = simplified_surface(mesh.clone(), whole.kept().to_vec(), bound_m)?;
    let surfaces = [whole, fewer];
    let targets = surfaces.each_ref().map(|surface| Target::new(surface.clone(), Builder::Sah));
    let ray_sets = targets.each_ref().map(|target| -> Vec<RaySet> {
        let sweep = |pose| RaySet::sweep(target, pose, &pattern, Culling::Off);
        views.iter().map(sweep).collect()
    });
    let jobs = ray_sets.each_ref().map(|ray_sets| -> Vec<CastJob> {
        ray_sets.iter().map(|ray_set| ray_set.job.clone()).collect()
    });

    let mut workloads: Vec<Workload<'_>> =
        vec![workload(|| Ok(simplified(mesh, surfaces[0].kept(), bound_m)?))];
    workloads.extend(surfaces.iter().map(|surface| building(surface, Builder::Sah)));
    let backends: Vec<&Backend> =
        backends.iter().filter(|backend| backend.caster.fits(&targets[0])).collect();
    for backend in &backends {
        workloads.extend(jobs.iter().map(|jobs| casting(backend, jobs.clone())));
    }
    let mut costs = interleave(rounds, &mut workloads)?.into_iter();
    let mut next = || costs.next().unwrap_or_default();
    let (simplify, build) = (next(), [next(), next()]);
    let rays = jobs[0].iter().map(|job| job.beams.len()).sum();
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

/// CPU seconds of some work on the mesh as it is, and on what is left of it.
fn both(costs: &[Costs; 2]) -> [f64; 2] {
    costs.each_ref().map(|costs| costs.cpu_s().median)
}

impl Simplified {
    /// The figures for people.
    pub fn tables(&self) -> Vec<Table> {
        vec![self.cost_table(), self.moved_table()]
    }

    fn cost_table(&self) -> Table {
        type Row<'a> = (&'a SimplifiedMesh, &'a Traced);
        let pairs =
            self.0.iter().flat_map(|mesh| mesh.traces.iter().map(move |trace| (mesh, trace)));
        let arrow = |[p, q]: [f64; 2]| format!("{} -> {}", milliseconds(p), milliseconds(q));
        // How many times as fast, if what is left takes `more_s` seconds more.
        let gain = |(mesh, traced): &Row<'_>, more_s: f64| {
            let ([build, fewer_build], [trace, fewer_trace]) =
                (both(&mesh.build), both(&traced.trace));
            format!("{}x", digits((build + trace) / (fewer_build + fewer_trace + more_s)))
        };
        let simplify = |mesh: &SimplifiedMesh| mesh.simplify.cpu_s().median;
        let columns: [Column<'_, Row<'_>>; 9] = [
            ("mesh", &|(mesh, _)| mesh.mesh.clone()),
            ("triangles", &|(mesh, _)| mesh.triangles.to_string()),
            ("left", &|(mesh, _)| mesh.triangles_left.to_string()),
            ("adapter", &|(_, traced)| short(&traced.adapter)),
            ("build", &|(mesh, _)| arrow(both(&mesh.build))),
            ("trace", &|(_, traced)| arrow(both(&traced.trace))),
            ("both faster", &|row| gain(row, 0.0)),
            ("simplify itself", &|(mesh, _)| milliseconds(simplify(mesh))),
            ("all three", &|row| gain(row, simplify(row.0))),
        ];
        let title = "--simplify auto, CPU ms: as it is -> simplified (VLP-32C, 4 revolutions from \
                     3 m, no culling; SAH)";
        Table::of(title, &pairs.collect::<Vec<_>>(), &columns)
    }

    fn moved_table(&self) -> Table {
        let mm = |metres: f64| digits(1e3 * metres);
        let percent = |n: usize, of: &Moved| digits(100.0 * n as f64 / of.hits.max(1) as f64);
        let columns: [Column<'_, SimplifiedMesh>; 8] = [
            ("mesh", &|mesh| mesh.mesh.clone()),
            ("hits", &|mesh| mesh.moved.hits.to_string()),
            ("bound", &|mesh| mm(mesh.bound_m)),
            ("farthest", &|mesh| mm(mesh.moved.farthest_m)),
            ("range median", &|mesh| mm(mesh.moved.median_m)),
            ("99 %", &|mesh| mm(mesh.moved.most_m)),
            ("within bound/cos %", &|mesh| percent(mesh.moved.within_oblique, &mesh.moved)),
            ("other hit or miss %", &|mesh| percent(mesh.moved.hit_by_one, &mesh.moved)),
        ];
        let title = "What it moves: points of the simplified scan against the mesh as it is, mm; \
                     range errors of beams without width";
        Table::of(title, &self.0, &columns)
    }
}
