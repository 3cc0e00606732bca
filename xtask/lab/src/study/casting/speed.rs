//! How fast hierarchies are built and rays are traced.

use super::kernel;
use crate::measure::clock::{Contestant, Cost, Costs, Spread, interleave, measured};
use crate::measure::lanes::Lane;
use crate::measure::scenes::in_a_room;
use crate::measure::shot::Shot;
use crate::measure::subject::Subject;
use crate::render::table::{Table, digits, millions_per_s, milliseconds};
use anyhow::Result;
use glam::{DVec3, dvec3};
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::{Mesh, validate};
use sim_gpu::pose::Pose;
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;

/// The sweeps stand 5 m away, as those of the published comparisons do.
const SENSOR_M: DVec3 = dvec3(5.0, 0.0, 0.5);

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

/// Measures `subjects` on `lanes` in `rounds` rounds each.
///
/// # Errors
/// If an adapter fails.
pub fn measure(subjects: &[Subject], lanes: &[Lane], rounds: usize) -> Result<Speed> {
    let mut speed = Speed::default();
    let pattern = vlp32c();
    for subject in subjects {
        eprintln!("{}", subject.name);
        builds(subject, rounds, &mut speed)?;
        let object = target(subject.mesh.clone(), Builder::Sah);
        let room = target(in_a_room(subject.mesh.clone()), Builder::Sah);
        let pose = sweep_pose()?;
        for (name, shot, beams) in [
            ("sweep, all hit", Shot::sweep(&room, &pose, &pattern, Culling::Off), pattern.len()),
            ("sweep, object", Shot::sweep(&object, &pose, &pattern, Culling::On), pattern.len()),
            ("incoherent", Shot::incoherent(&object, pattern.len()), pattern.len()),
        ] {
            traces(subject, (name, &shot, beams), lanes, rounds, &mut speed)?;
        }
    }
    Ok(speed)
}

/// The beams of the true VLP-32C at 600 rpm.
pub fn vlp32c() -> BeamPattern {
    let sensor = Sensor::builtin("vlp32c").expect("invariant: this profile is built in");
    sensor.pattern()
}

/// Where sweeps are made from.
///
/// # Errors
/// Never: the place is fixed and good.
pub fn sweep_pose() -> Result<Pose> {
    Ok(Pose::look_at(SENSOR_M, DVec3::ZERO)?)
}

/// `mesh` as casters want it.
pub fn target(mesh: Mesh, builder: Builder) -> Target {
    let kept = validate::triangle_stats(&mesh).kept;
    Target::new(Surface::new(mesh, kept), builder)
}

fn builds(subject: &Subject, rounds: usize, speed: &mut Speed) -> Result<()> {
    let kept = validate::triangle_stats(&subject.mesh).kept;
    let triangles = kept.len();
    let surface = Surface::new(subject.mesh.clone(), kept);
    let builders = [Builder::Sah, Builder::Morton];
    let mut contestants: Vec<Contestant<'_>> = builders
        .iter()
        .map(|&builder| {
            let surface = &surface;
            let contestant: Contestant<'_> = Box::new(move || {
                let surface = surface.clone();
                let (built, cost) = measured(|| Target::new(surface, builder));
                black_box(built);
                Ok(cost)
            });
            contestant
        })
        .collect();
    for (costs, builder) in interleave(rounds, &mut contestants)?.into_iter().zip(builders) {
        let (mesh, builder) = (subject.name.clone(), format!("{builder:?}"));
        speed.builds.push(Build { mesh, triangles, builder, costs });
    }
    Ok(())
}

fn traces(
    subject: &Subject,
    (rays_from, shot, beams): (&'static str, &Shot, usize),
    lanes: &[Lane],
    rounds: usize,
    speed: &mut Speed,
) -> Result<()> {
    let cast = sim_gpu::cpu::trace::cast(&shot.job, &sim_gpu::effects::Effects::default());
    let hits = cast.codes.iter().filter(|&&code| code != sim_gpu::ray::MISS).count();
    let fitting = |lane: &&Lane| {
        let fits = lane.caster.fits(&shot.job.target);
        if !fits {
            eprintln!("{}: {} exceeds its bindings", lane.name(), subject.name);
        }
        fits
    };
    let lanes: Vec<&Lane> = lanes.iter().filter(fitting).collect();
    let copies = |lane: &Lane| lane.rays.div_ceil(shot.job.rays.len().max(1));
    let mut contestants: Vec<Contestant<'_>> =
        lanes.iter().map(|lane| casting(lane, vec![shot.job.clone(); copies(lane)])).collect();
    let costs = interleave(rounds, &mut contestants)?;
    for (lane, costs) in lanes.iter().zip(costs) {
        speed.traces.push(Trace {
            mesh: subject.name.clone(),
            triangles: shot.job.target.surface.len(),
            rays_from,
            adapter: lane.name().to_owned(),
            rays: copies(lane) * shot.job.rays.len(),
            beams: copies(lane) * beams,
            hits: copies(lane) * hits,
            costs,
            kernel_s: kernel::measure(lane, &shot.job, copies(lane), rounds)?,
        });
    }
    Ok(())
}

/// Casts `jobs` on `lane`, all together.
pub fn casting<'a>(lane: &'a Lane, jobs: Vec<CastJob>) -> Contestant<'a> {
    Box::new(move || {
        let (casts, cost): (_, Cost) = measured(|| lane.caster.cast(&jobs));
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

/// An adapter's name, short enough for a table.
pub fn short(name: &str) -> String {
    name.split(" (").next().unwrap_or(name).to_owned()
}
