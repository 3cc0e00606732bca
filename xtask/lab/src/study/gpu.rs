//! `cargo xtask bench gpu`: all that a machine with a GPU is borrowed for, in one call of some
//! minutes.
//!
//! The first parts compare every shader with its counterpart on the CPU, the others measure
//! speed and memory. `gpu.json` is rewritten after each part, so that a run that is interrupted
//! loses one part. Neither the network nor any file beside the program is needed: a copy of
//! `edgepuck-lab` runs anywhere. Networks learn on the CPU alone, so that no training is measured.

use crate::measure::backends::{self, Backend, short};
use crate::measure::bench_mesh::{self, BenchMesh, target};
use crate::measure::machine::{self, Machine};
use crate::measure::ray_set::{sweep_pose, vlp32c};
use crate::study::{speed, to_disk};
use crate::table::{Column, Table, digits, write_json};
use anyhow::{Context, Error, Result, bail};
use clap::Args;
use edgepuck_mesh::TriangleMesh;
use edgepuck_mesh::frame::{Normalize, Up, to_world};
use edgepuck_shapes::{ShapeClass, generate, write_tree};
use glam::DVec3;
use harness::adversarial::{from_inside, missed, moved_sphere};
use harness::casting::job;
use harness::effects::{EffectVerdict, judge_effects};
use harness::meshes::{cube, icosphere, soup};
use program::Outcome;
use serde::Serialize;
use serde_json::{Value, json};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::gpu::{AdapterKind, list_adapters};
use sim_gpu::internals::resolve::{Hit, resolve};
use sim_gpu::{Caster, Mesh, Moves, Pose, Scene, Sensor};
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;
use xtask::workspace::root;

#[derive(Args, Debug)]
pub struct GpuArgs {
    /// Meshes to scan in addition to the generated ones, at most 512: a file or a folder [default:
    /// assets/meshes of the workspace, if it is there].
    meshes: Option<PathBuf>,
    /// Folder in which to write gpu.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Measure all adapters, also software Vulkan [default: the best GPU].
    #[arg(long)]
    all: bool,
    /// Measure few meshes and rays, in seconds.
    #[arg(long)]
    quick: bool,
}

struct Size {
    /// Number of generated and of given meshes.
    meshes: usize,
    views: u32,
    /// Level of the sphere at whose vertices and edges rays are aimed.
    sphere_level: u32,
    /// Rows of a batch.
    rows: u32,
    /// Sizes of the meshes at which rays are timed.
    triangles: &'static [usize],
    rounds: usize,
}

const FULL: Size = Size {
    meshes: 512,
    views: 4,
    sphere_level: 5,
    rows: 256,
    triangles: &[1_000, 10_000, 100_000, 1_000_000],
    rounds: 3,
};

const QUICK: Size =
    Size { meshes: 2, views: 1, sphere_level: 2, rows: 4, triangles: &[1_000], rounds: 1 };

#[derive(Serialize)]
struct Report {
    machine: Machine,
    checks: Vec<Check>,
    parts: Vec<Part>,
    #[serde(skip)]
    file: PathBuf,
}

#[derive(Clone, Serialize)]
struct Check {
    what: String,
    adapter: String,
    found: String,
    passed: bool,
}

#[derive(Serialize)]
struct Part {
    name: &'static str,
    seconds: f64,
    peak_memory_bytes: Option<u64>,
    /// Bytes in the casters' buffers, by adapter.
    held_bytes: Vec<(String, Option<u64>)>,
    figures: Value,
}

/// The result of a part: figures, tables and checks.
type Found = (Value, Vec<Table>, Vec<Check>);

/// Runs all parts, also after a failed check.
pub fn run(args: &GpuArgs) -> Result<Outcome> {
    let size = if args.quick { QUICK } else { FULL };
    let file = args.out.join("gpu.json");
    let mut report = Report { machine: Machine::here(), checks: vec![], parts: vec![], file };
    let backends = report.open(args)?;
    let others = &backends[1..];
    let meshes = meshes(args, &size)?;
    report.part("scans", &backends, || scans(&meshes, &size, &backends))?;
    report.part("rays at vertices and edges", &backends, || lost(&size, &backends))?;
    report.part("effects", &backends, || effects(&meshes, others))?;
    report.part("speed", &backends, || {
        let measured = speed::tracing(&bench_mesh::tori(size.triangles), &backends, size.rounds)?;
        Ok((serde_json::to_value(&measured)?, vec![measured.table()], vec![]))
    })?;
    report.part("batches", &backends, || batches(&size, &backends))?;
    report.part("datasets", &backends, || datasets(args, &size, &backends))?;
    print!("{}", report.table());
    Ok(report.outcome())
}

/// Surfaces that are smooth, edged and crossing, shapes, and real meshes.
fn meshes(args: &GpuArgs, size: &Size) -> Result<Vec<BenchMesh>> {
    let named = |(name, mesh): (&str, TriangleMesh)| BenchMesh { name: name.to_owned(), mesh };
    let made = [("soup", soup(2000, 0.2)), ("sphere", icosphere(4)), ("cube", cube())];
    let mut all: Vec<BenchMesh> = made.into_iter().map(named).collect();
    all.extend(ShapeClass::ALL.into_iter().take(size.meshes).map(shape));
    let given = args.meshes.clone();
    let folder = given.or_else(|| Some(root().join("assets/meshes")).filter(|path| path.is_dir()));
    if let Some(folder) = folder {
        all.extend(bench_mesh::real(&folder, size.meshes)?);
    }
    Ok(all)
}

fn shape(class: ShapeClass) -> BenchMesh {
    let mesh = to_world(&generate(class, 0, 0), Up::Z, Normalize::UnitSphere).mesh;
    BenchMesh { name: format!("shape {class}"), mesh }
}

/// The hits of scans, which every adapter finds as the CPU does, to the bit:
/// `shaders/{trace,traverse,intersect}.wgsl`.
fn scans(meshes: &[BenchMesh], size: &Size, backends: &[Backend]) -> Result<Found> {
    /// From the middle of a mesh of the unit sphere, metres.
    const DISTANCE_M: f64 = 3.0;
    let pattern = vlp32c().pattern();
    let (mut points, mut unequal) = (0, vec![Vec::new(); backends.len()]);
    for bench_mesh in meshes {
        let target = target(bench_mesh.mesh.clone());
        for view in 0..size.views {
            let azimuth_rad = TAU * f64::from(view) / f64::from(size.views) + 0.3;
            let pose = Pose::view(DISTANCE_M, 20f64.to_radians(), azimuth_rad, DVec3::ZERO);
            let job = job(&target, &pose, &pattern);
            let hits = |backend: &Backend| -> Result<Vec<Hit>> {
                let cast = backend.caster.cast(std::slice::from_ref(&job))?.swap_remove(0);
                Ok(resolve(&job, &cast, &pattern, &Effects::default()).hits)
            };
            let of_cpu = hits(&backends[0])?;
            points += of_cpu.len();
            for (backend, unequal) in backends.iter().zip(&mut unequal).skip(1) {
                if hits(backend)? != of_cpu {
                    unequal.push(format!("{}, view {view}", bench_mesh.name));
                }
            }
        }
    }
    let (mut figures, mut checks) = (Vec::new(), Vec::new());
    for (backend, unequal) in backends.iter().zip(&unequal).skip(1) {
        let n_scans = meshes.len() * size.views as usize;
        let first = unequal.first().map(|name| format!(": {name}")).unwrap_or_default();
        let found = format!("{points} points, {} of {n_scans} unequal{first}", unequal.len());
        checks.push(Check::new("scans", backend, found, unequal.is_empty() && points > 0));
        figures.push(json!({ "adapter": backend.name(), "scans": n_scans, "unequal": unequal }));
    }
    Ok((figures.into(), vec![], checks))
}

/// Rays from within a closed sphere through its vertices and edges: none may miss, neither
/// before f64 decides on rays that f32 leaves open, nor after.
fn lost(size: &Size, backends: &[Backend]) -> Result<Found> {
    let target = target(moved_sphere(size.sphere_level));
    let (mut figures, mut checks) = (Vec::new(), Vec::new());
    for backend in backends {
        let (mut rays, mut lost) = (0, [0, 0]);
        for (job, pattern) in from_inside(&target) {
            let missed = missed(&backend.caster, &job, &pattern)?;
            rays += pattern.len();
            lost = [0, 1].map(|i| lost[i] + missed[i]);
        }
        let [in_f32, after_f64] = lost;
        let found = format!("of {rays}, {in_f32} missed in f32, {after_f64} after f64");
        checks.push(Check::new("rays at vertices and edges", backend, found, lost == [0, 0]));
        figures.push(json!({
            "adapter": backend.name(),
            "rays": rays,
            "missed_in_f32": in_f32,
            "missed": after_f64,
        }));
    }
    Ok((figures.into(), vec![], checks))
}

/// The outputs of `shaders/effects/*.wgsl` beside those of their counterparts in f64. Rounding
/// to a quantum is left out: the CPU rounds the ranges of all adapters.
fn effects(meshes: &[BenchMesh], others: &[Backend]) -> Result<Found> {
    let (mut figures, mut checks) = (Vec::new(), Vec::new());
    for backend in others {
        let verdicts = effect_verdicts(meshes, backend)?;
        for (name, _) in edgepuck_shaders::EFFECTS {
            let (figure, check) = effect_check(name, backend, &verdicts);
            figures.push(figure);
            checks.push(check);
        }
    }
    Ok((figures.into(), vec![], checks))
}

fn effect_verdicts(meshes: &[BenchMesh], backend: &Backend) -> Result<Vec<EffectVerdict>> {
    let pattern = vlp32c().pattern();
    let mut verdicts = Vec::new();
    for model in NoiseModel::ALL {
        let effects = Effects {
            noise: Some(Noise { mean_m: 0.1, sigma_m: 0.5, model }),
            dropout: Some(Dropout { probability: 0.25 }),
            intensity: Some(Intensity),
            ..Effects::default()
        };
        let caster = OpenCaster::open(&backend.request(), &effects)?;
        for bench_mesh in meshes {
            let target = target(bench_mesh.mesh.clone());
            let job = job(&target, &sweep_pose(), &pattern);
            let cast = caster.cast(std::slice::from_ref(&job))?.swap_remove(0);
            verdicts.extend(judge_effects(&job, &pattern, &cast, &effects));
        }
    }
    Ok(verdicts)
}

/// Checks all `verdicts` on the effect `name`.
fn effect_check(name: &str, backend: &Backend, verdicts: &[EffectVerdict]) -> (Value, Check) {
    let own = || verdicts.iter().filter(|verdict| verdict.name == name);
    let outputs: usize = own().map(|verdict| verdict.outputs).sum();
    let broken: Vec<&String> = own().flat_map(|verdict| &verdict.broken).collect();
    let worst = own().map(|verdict| verdict.worst_of_tolerance).fold(0.0, f64::max);
    let mut found = format!("{outputs} outputs, {} % of the tolerance", digits(100.0 * worst));
    if let Some(first) = broken.first() {
        found += &format!(", {} beyond it: {first}", broken.len());
    }
    let passed = broken.is_empty() && outputs > 0;
    let figure = json!({
        "adapter": backend.name(),
        "effect": name,
        "outputs": outputs,
        "worst_of_tolerance": worst,
        "beyond_tolerance": broken.len(),
    });
    (figure, Check::new(&format!("effect {name}"), backend, found, passed))
}

/// A batch of a sensor among twenty tori that stand elsewhere in each row, as a learning loop casts it.
/// Every adapter gives the CPU's ranges, to the bit.
fn batches(size: &Size, backends: &[Backend]) -> Result<Found> {
    let torus = Mesh::try_from(bench_mesh::torus(10_000))?;
    let mut scene = Scene::new();
    let tori: Vec<_> = (0..20).map(|_| scene.add(&torus, Pose::IDENTITY)).collect();
    let sensor = Sensor::named("vlp32c")?;
    let poses = vec![Pose::IDENTITY; size.rows as usize];
    let place = |i: u32| {
        let angle_rad = 0.7 * f64::from(i);
        let range_m = 3.0 + f64::from(i % 17);
        Pose::at([range_m * angle_rad.cos(), range_m * angle_rad.sin(), 0.0])
    };
    let moved: Vec<Pose> = (0..size.rows * tori.len() as u32).map(place).collect();
    let moves = Moves { instances: &tori, poses: &moved };
    let (mut figures, mut checks, mut of_cpu) = (Vec::new(), Vec::new(), None);
    for backend in backends {
        let caster = Caster::named(backend.name())?;
        let batch = || scene.batch(&sensor, &poses).moving(moves).with(&caster).run();
        let cast = batch()?;
        let mut seconds = Vec::new();
        for _ in 0..size.rounds {
            let start = Instant::now();
            batch()?;
            seconds.push(start.elapsed().as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        let rays_per_s = cast.range_m.len() as f64 / seconds[seconds.len() / 2];
        let is_equal = of_cpu.as_ref().is_none_or(|of_cpu| *of_cpu == cast);
        let found = format!("{} million rays a second", digits(rays_per_s / 1e6));
        checks.push(Check::new("batches", backend, found, is_equal));
        figures.push(json!({ "adapter": backend.name(), "rays_per_s": rays_per_s }));
        of_cpu.get_or_insert(cast);
    }
    Ok((figures.into(), vec![], checks))
}

fn datasets(args: &GpuArgs, size: &Size, backends: &[Backend]) -> Result<Found> {
    let shapes = tempfile::tempdir()?;
    let folder = match &args.meshes {
        Some(folder) => folder.as_path(),
        None => {
            write_tree(shapes.path(), 0, 6, 6)?;
            shapes.path()
        }
    };
    let measured = to_disk::measure(folder, size.meshes, backends, size.rounds)?;
    Ok((serde_json::to_value(&measured)?, vec![to_disk::table(&measured)], vec![]))
}

impl Report {
    /// The CPU and the adapters to measure. Those that do not open are failures.
    fn open(&mut self, args: &GpuArgs) -> Result<Vec<Backend>> {
        let mut backends = vec![backends::cpu()];
        for adapter in list_adapters() {
            let is_wanted = args.all || adapter.kind != AdapterKind::Software && backends.len() < 2;
            if !is_wanted || backends.iter().any(|backend| backend.name() == adapter.name) {
                continue;
            }
            match backends::of_adapter(&adapter) {
                Ok(backend) => backends.push(backend),
                Err(error) => {
                    eprintln!("{error:#}");
                    self.checks.push(Check::failed("open", &adapter.name, &error));
                }
            }
        }
        if backends.len() > 1 {
            return Ok(backends);
        }
        let hint = if args.all { "" } else { "; `--all` also measures software Vulkan" };
        bail!("expected a GPU that opens, found none{hint}")
    }

    /// Runs one part and writes the report. An error fails this part alone.
    fn part(
        &mut self,
        name: &'static str,
        backends: &[Backend],
        measure: impl FnOnce() -> Result<Found>,
    ) -> Result<()> {
        eprintln!("{name} ...");
        let start = Instant::now();
        let (figures, tables, checks) = measure()
            .unwrap_or_else(|error| (Value::Null, vec![], vec![Check::failed(name, "-", &error)]));
        let seconds = start.elapsed().as_secs_f64();
        eprintln!("{name}: {seconds:.1} s");
        tables.iter().for_each(|table| print!("{table}"));
        self.checks.extend(checks);
        let held = |backend: &Backend| match &backend.caster {
            OpenCaster::Cpu(_) => None,
            OpenCaster::Gpu(gpu) => Some((backend.name().to_owned(), gpu.held_bytes())),
        };
        self.parts.push(Part {
            name,
            seconds,
            peak_memory_bytes: machine::peak_memory_bytes(),
            held_bytes: backends.iter().filter_map(held).collect(),
            figures,
        });
        write_json(self, Some(&self.file)).context("writing the report")
    }

    fn table(&self) -> Table {
        let of_check: [Column<Check>; 4] = [
            ("check", &|check| check.what.clone()),
            ("adapter", &|check| short(&check.adapter)),
            ("found", &|check| check.found.clone()),
            ("result", &|check| if check.passed { "passed" } else { "FAILED" }.to_owned()),
        ];
        Table::of("Adapters beside the CPU", &self.checks, &of_check)
    }

    /// A failure if a check failed, or nothing was checked.
    fn outcome(&self) -> Outcome {
        let passed = !self.checks.is_empty() && self.checks.iter().all(|check| check.passed);
        if passed { Outcome::Success } else { Outcome::SomeFailed }
    }
}

impl Check {
    fn new(what: &str, backend: &Backend, found: String, passed: bool) -> Self {
        Self { what: what.to_owned(), adapter: backend.name().to_owned(), found, passed }
    }

    fn failed(what: &str, adapter: &str, error: &Error) -> Self {
        let found = format!("{error:#}");
        Self { what: what.to_owned(), adapter: adapter.to_owned(), found, passed: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> (tempfile::TempDir, Report) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out/gpu.json");
        (folder, Report { machine: Machine::here(), checks: vec![], parts: vec![], file })
    }

    fn check(passed: bool) -> Check {
        Check::new("a check", &backends::cpu(), String::new(), passed)
    }

    #[test]
    fn one_failure_among_passed_checks_fails_the_run_and_is_in_the_report() {
        let (_folder, mut report) = report();
        assert_eq!(report.outcome(), Outcome::SomeFailed, "nothing was checked");
        report.part("a", &[], || Ok((Value::Null, vec![], vec![check(true)]))).unwrap();
        assert_eq!(report.outcome(), Outcome::Success);
        report.part("b", &[], || bail!("the device was lost")).unwrap();
        report.part("c", &[], || Ok((Value::Null, vec![], vec![check(true)]))).unwrap();
        assert_eq!(report.outcome(), Outcome::SomeFailed);
        let written = std::fs::read_to_string(&report.file).unwrap();
        let written: Value = serde_json::from_str(&written).unwrap();
        assert_eq!(written["parts"].as_array().unwrap().len(), 3);
        assert_eq!(written["checks"][1]["found"], "the device was lost");
    }
}
