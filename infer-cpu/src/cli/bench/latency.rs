//! How long a classification takes.

use std::collections::BTreeMap;
use std::io::{Write, stdout};
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use formats::rng::StreamKey;
use infer_cpu::{Classifier, ModelCard};
use serde::Serialize;

use super::grid::{Setting, settings};
use super::machine::Machine;
use super::statistics::quantile;
use super::{Args, table};

/// Everything that a run measured.
#[derive(Serialize)]
struct Record {
    machine: Machine,
    model: String,
    rows: Vec<Row>,
}

/// One setting's samples.
#[derive(Serialize)]
struct Row {
    sampler: String,
    t_nets: &'static str,
    points: usize,
    /// Points of the clouds that were classified.
    from: usize,
    precision: &'static str,
    threads: usize,
    kernel: &'static str,
    p50_ms: f64,
    p99_ms: f64,
    samples_ms: Vec<f64>,
}

/// Measures every setting and prints it.
///
/// # Errors
/// A model that cannot be loaded, a cloud that cannot be classified.
pub fn run(args: &Args, model: &Path) -> anyhow::Result<()> {
    let ranges = super::calibration(args, model)?;
    let rows = settings(args);
    let rows = rows.iter().map(|setting| measure(args, model, setting, &ranges));
    let record = Record {
        machine: Machine::here(),
        model: model.display().to_string(),
        rows: rows.collect::<anyhow::Result<_>>()?,
    };
    if args.json {
        writeln!(stdout(), "{}", serde_json::to_string(&record)?)?;
        return Ok(());
    }
    let header = [
        "sampler",
        "T-Nets",
        "precision",
        "kernel",
        "from",
        "points",
        "threads",
        "p50 ms",
        "p99 ms",
    ];
    let cells = |row: &Row| {
        vec![
            row.sampler.clone(),
            row.t_nets.to_owned(),
            row.precision.to_owned(),
            row.kernel.to_owned(),
            row.from.to_string(),
            row.points.to_string(),
            row.threads.to_string(),
            format!("{:.3}", row.p50_ms),
            format!("{:.3}", row.p99_ms),
        ]
    };
    let card = ModelCard::read(model)?;
    let untrained = if card.trained { "" } else { ", untrained: its weights are random" };
    writeln!(stdout(), "{}{untrained}", record.model)?;
    table::print(&header, 4, &record.rows.iter().map(cells).collect::<Vec<_>>())?;
    Ok(())
}

fn measure(
    args: &Args,
    model: &Path,
    setting: &Setting,
    ranges: &Option<BTreeMap<String, f32>>,
) -> anyhow::Result<Row> {
    let from = if setting.sampler.takes_all() { setting.points } else { args.from };
    let mut options = setting.options(args, from);
    options.activation_ranges.clone_from(ranges);
    let mut classifier = Classifier::load(model, &options)?;
    let cloud = cloud(from);
    // Once for caches, pages and sleeping threads.
    classifier.classify(&cloud).context("classifying a random cloud")?;
    let mut samples_ms = Vec::with_capacity(args.repeats as usize);
    for _ in 0..args.repeats {
        let start = Instant::now();
        classifier.classify(&cloud)?;
        samples_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(Row {
        sampler: setting.sampler.to_string(),
        t_nets: setting.t_nets.name(),
        points: setting.points,
        from,
        precision: setting.precision.name(),
        threads: setting.threads,
        kernel: classifier.kernel().name(),
        p50_ms: quantile(&samples_ms, 0.5),
        p99_ms: quantile(&samples_ms, 0.99),
        samples_ms,
    })
}

/// Points all over a cube, the same in every run.
fn cloud(n: usize) -> Vec<[f32; 3]> {
    let key = StreamKey::new(0, "benchmark cloud", 0);
    let unit = |i: usize| (2.0 * key.unit(i as u64) - 1.0) as f32;
    (0..n).map(|i| [unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)]).collect()
}
