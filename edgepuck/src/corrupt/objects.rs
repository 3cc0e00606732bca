use super::plan::{Plan, chosen};
use super::{CorruptArgs, Written, ended, remove_former, usage, write_list};
use crate::Outcome;
use crate::flags::first_given;
use crate::gen_dataset::{listed, print_notes, report_failures};
use anyhow::Context;
use edgepuck_dataset::{Corrupted, CorruptedSet, ObjectCorruption, Progress, Up, Views};
use formats::Split;
use indicatif::{ProgressBar, ProgressStyle};
use sim_gpu::Sensor;
use std::path::Path;

/// Flags for meshes.
#[derive(clap::Args)]
pub(super) struct ObjectArgs {
    /// For meshes: number of views of each mesh, evenly around it [default: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: Option<u32>,

    /// For meshes: distance of the sensor, metres; a mesh has a radius of 1 m [default: 3]
    #[arg(long, value_name = "M", value_parser = crate::flags::positive)]
    distance: Option<f64>,

    /// For meshes: number of points of each cloud [default: 1024]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    points: Option<u32>,

    /// For meshes: the upward axis [default: y for OBJ and glTF, z for others]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,
}

impl ObjectArgs {
    /// A flag that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        first_given(&[
            (self.views.is_some(), "--views"),
            (self.distance.is_some(), "--distance"),
            (self.points.is_some(), "--points"),
            (self.up.is_some(), "--up"),
        ])
    }
}

/// Writes a packed set for each corruption and severity, and one of clean scans.
pub(super) fn run(
    args: &CorruptArgs,
    folder: &Path,
    plan: &Plan,
    sensor: &Sensor,
) -> anyhow::Result<Outcome> {
    let chosen = chosen(&plan.object, &args.only, &args.severity)?;
    let ObjectArgs { views, distance, points, up } = args.objects;
    let (count, distance_m) = (views.unwrap_or(4), distance.unwrap_or(3.0));
    let (points, views) = (points.unwrap_or(1024), Views { count, distance_m, ..Views::ROTATING });
    views.validate().map_err(usage)?;
    let meshes = listed(folder, args.seed)?;
    let tested = meshes.iter().filter(|entry| entry.split == Split::Test).count();
    anyhow::ensure!(tested > 0, "{}: expected a mesh for testing, found none", folder.display());
    let set = |name: String, corruption: &ObjectCorruption| {
        CorruptedSet::new(name.clone(), corruption.clone(), sensor).context(name)
    };
    let mut sets = vec![set("clean".to_owned(), &ObjectCorruption::default())?];
    for (entry, severity, corruption) in &chosen {
        sets.push(set(format!("{}-{severity}", entry.name), corruption)?);
    }
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} meshes, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(tested as u64).with_style(style);
    let (out, seed) = (&*args.out, args.seed);
    let corrupted = Corrupted { out, sensor, views, up, points, seed };
    let progress = Progress::default();
    remove_former(out, folder)?;
    let written = corrupted.write(&meshes, &sets, &progress, || bar.inc(1))?;
    bar.finish_and_clear();
    print_notes(&progress.notes());
    report_failures(&written.failures);

    let clean = ("clean", 0, "nothing");
    let named = chosen.iter().map(|(entry, severity, _)| (&*entry.name, *severity, &*entry.by));
    let named = std::iter::once(clean).chain(named).zip(&sets).zip(&written.clouds);
    let of = written.of;
    let lines: Vec<Written<'_>> = named
        .map(|(((corruption, severity, by), set), &count)| {
            if count < of {
                formats::say!("{}: {} of {of} views have no point", set.name, of - count);
            }
            let file = format!("{}-test.npz", set.name);
            Written { file, corruption, severity, count, of, by }
        })
        .collect();
    write_list(&lines, out)?;
    formats::say!("{} sets of {tested} meshes: {}", lines.len(), out.display());
    if !written.failures.is_empty() {
        return Ok(Outcome::SomeRefused);
    }
    Ok(ended(&lines))
}
