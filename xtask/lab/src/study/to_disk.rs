//! The whole way to disk: the default dataset with noise, as `gen-dataset --noise 0.01` makes it, in a
//! folder that is removed again.

use crate::measure::backends::{Backend, short};
use crate::measure::bench_mesh::some_of;
use crate::measure::clock::{Cost, measured};
use crate::table::{Table, digits};
use anyhow::{Context, Result};
use edgepuck_dataset::{DatasetConfig, Plan, Progress, Stage, make};
use edgepuck_mesh::tree::MeshEntry;
use serde::Serialize;
use sim_gpu::Caster;
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;

#[derive(Serialize)]
pub struct Dataset {
    adapter: String,
    meshes: usize,
    scans: u64,
    points: u64,
    rays_cast: u64,
    rays_culled: u64,
    /// The repeat of the median CPU time.
    cost: Cost,
    /// Seconds that all threads together spent in each stage of that repeat.
    stages: Vec<(&'static str, f64)>,
}

/// Makes the default dataset of at most `limit` of the meshes under `root`, on
/// each of `backends`, `rounds` times.
pub fn measure(
    root: &Path,
    limit: usize,
    backends: &[Backend],
    rounds: usize,
) -> Result<Vec<Dataset>> {
    let meshes = some_of(root, limit)?;
    let effects = edgepuck_dataset::noisy(0.01, 0.0)?;
    let config = DatasetConfig { effects, ..DatasetConfig::default() }.checked()?;
    let mut datasets = Vec::new();
    for backend in backends {
        let caster = Caster::named(backend.name())?;
        let once = |_| once(&config, &caster, &meshes);
        let mut repeats = (0..rounds).map(once).collect::<Result<Vec<_>>>()?;
        repeats.sort_by(|a, b| a.cost.cpu_s.total_cmp(&b.cost.cpu_s));
        datasets.extend(repeats.into_iter().nth(rounds / 2));
    }
    Ok(datasets)
}

fn once(config: &DatasetConfig, caster: &Caster, meshes: &[MeshEntry]) -> Result<Dataset> {
    let folder = tempfile::tempdir()?;
    let (plan, progress) = (Plan::new(folder.path(), config, meshes), Progress::default());
    let (made, cost) = measured(|| make(&plan, caster, &progress));
    let made = made.context("making the default dataset")?;
    Ok(Dataset {
        adapter: caster.name().to_owned(),
        meshes: made.meshes.len(),
        scans: progress.scans.load(Relaxed),
        points: progress.points.load(Relaxed),
        rays_cast: progress.rays_cast.load(Relaxed),
        rays_culled: progress.rays_culled.load(Relaxed),
        cost,
        stages: Stage::ALL.map(|s| (s.name(), progress.spent(s).as_secs_f64())).to_vec(),
    })
}

pub fn table(datasets: &[Dataset]) -> Table {
    let mut heading = vec!["adapter", "meshes", "scans", "points", "wall s", "CPU s"];
    heading.extend(Stage::ALL.map(Stage::name));
    heading.extend(["meshes/s", "meshes/CPU-s", "k rays/CPU-s", "k beams/CPU-s"]);
    let mut table = Table::new(
        "From file to disk: the default dataset (stages: seconds of all threads, share; waiting \
         counts as casting)",
        &heading,
    );
    for d in datasets {
        let spent: f64 = d.stages.iter().map(|(_, s)| s).sum();
        let mut row = vec![short(&d.adapter), d.meshes.to_string()];
        row.extend([d.scans, d.points].map(|n| n.to_string()));
        row.extend([d.cost.wall_s, d.cost.cpu_s].map(digits));
        let share = |s: f64| format!("{} ({:.0} %)", digits(s), 100.0 * s / spent);
        row.extend(d.stages.iter().map(|&(_, s)| share(s)));
        row.push(digits(d.meshes as f64 / d.cost.wall_s));
        let per_cpu_s = |n: f64| digits(n / d.cost.cpu_s);
        row.push(per_cpu_s(d.meshes as f64));
        row.push(per_cpu_s(d.rays_cast as f64 / 1e3));
        row.push(per_cpu_s((d.rays_cast + d.rays_culled) as f64 / 1e3));
        table.push(row);
    }
    table
}
