//! Corruptions of scans of meshes.

use super::plan::{Plan, chosen};
use super::{Args, Made, usage, write_list};
use crate::Outcome;
use crate::gen_dataset::report_failures;
use anyhow::Context;
use edgepuck_dataset::corrupted::{Corrupted, CorruptedSet, ObjectCorruption};
use formats::Split;
use formats::labelled::read_labelled;
use indicatif::{ProgressBar, ProgressStyle};
use sim_gpu::effects::Effects;
use sim_gpu::mesh::frame::Up;
use sim_gpu::mesh::tree::discover;
use sim_gpu::sensor::{Sensor, Views};
use std::path::Path;

/// Flags about meshes.
#[derive(clap::Args)]
pub(super) struct ObjectArgs {
    /// Of meshes: views of each, evenly around it
    #[arg(long, default_value_t = 4, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,

    /// Of meshes: distance of the sensor, metres; a mesh has a radius of 1 m
    #[arg(long, default_value_t = 3.0, value_name = "M", value_parser = crate::flags::positive)]
    distance: f64,

    /// Of meshes: points of each cloud
    #[arg(long, default_value_t = 1024, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    points: u32,

    /// Of meshes: the upward axis [default: y of OBJ, z of all others]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,
}

/// Scans with fewer points are left out.
const MIN_POINTS: u32 = 16;

/// Writes one packed set for each corruption and severity, and one of clean scans.
pub(super) fn run(
    args: &Args,
    folder: &Path,
    plan: &Plan,
    sensor: &Sensor,
) -> anyhow::Result<Outcome> {
    let chosen = chosen(&plan.object, &args.only, &args.severity)?;
    let ObjectArgs { views: count, distance: distance_m, points, up } = args.objects;
    let views = Views { count, distance_m, ..Views::ROTATING };
    views.validate().map_err(usage)?;
    let meshes = discover(folder, args.seed)?;
    let tested = meshes.iter().filter(|entry| entry.split == Split::Test).count();
    anyhow::ensure!(tested > 0, "{}: expected a mesh for testing, found none", folder.display());
    args.caster.open(&Effects::default())?;
    let set = |name: String, corruption: &ObjectCorruption| {
        let open = |effects: &Effects| Ok::<_, anyhow::Error>(args.caster.open_quietly(effects)?.0);
        CorruptedSet::new(name.clone(), corruption.clone(), sensor, open).context(name)
    };
    let mut sets = vec![set("clean".to_owned(), &ObjectCorruption::default())?];
    for (entry, severity, corruption) in &chosen {
        sets.push(set(format!("{}-{severity}", entry.name), corruption)?);
    }
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} meshes, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(tested as u64).with_style(style);
    let (out, seed, min_points) = (&*args.out, args.seed, MIN_POINTS);
    let corrupted = Corrupted { out, sensor, views, up, points, min_points, seed };
    let failures = corrupted.write(&meshes, &sets, || bar.inc(1))?;
    bar.finish_and_clear();
    report_failures(&failures);

    let clean = ("clean", 0, "nothing");
    let named = chosen.iter().map(|(entry, severity, _)| (&*entry.name, *severity, &*entry.by));
    let mut made = Vec::new();
    for ((corruption, severity, by), set) in std::iter::once(clean).chain(named).zip(&sets) {
        let file = format!("{}-test.npz", set.name);
        let count = read_labelled(&out.join(&file))?.len();
        made.push(Made { file, corruption, severity, count, by });
    }
    write_list(&made, out)?;
    eprintln!("{} sets of {tested} meshes: {}", made.len(), out.display());
    Ok(if failures.is_empty() { Outcome::Success } else { Outcome::SomeFailed })
}
