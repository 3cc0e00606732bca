//! Measures the latency of classifications.

use std::hint::black_box;
use std::io::{Write, stdout};
use std::iter::repeat_n;
use std::path::Path;
use std::time::Instant;

use crate::model::network::open;
use crate::{Classifier, ClassifierTeam, Options, Precision};
use anyhow::Context;
use formats::streams::Stream;
use serde::Serialize;

use super::machine::Machine;
use super::variant::Variant;
use super::{BenchArgs, table};

#[derive(Serialize)]
struct Record {
    machine: Machine,
    model: String,
    rows: Vec<Timing>,
}

#[derive(Serialize)]
struct Timing {
    sampler: String,
    points: usize,
    /// The number of points of the classified clouds.
    from: usize,
    precision: &'static str,
    threads: usize,
    /// The number of clouds that were classified together; times are totals.
    clouds: usize,
    kernel: &'static str,
    p50_ms: f64,
    p99_ms: f64,
    samples_ms: Vec<f64>,
}

struct Setting<'a> {
    sampler: &'a Variant,
    /// The number of points that the network processes.
    points: usize,
    threads: usize,
    precision: Precision,
}

pub fn run(args: &BenchArgs, model: &Path) -> anyhow::Result<()> {
    // fp32 comes first, as the baseline of the others.
    let mut precisions = args.precision.clone();
    precisions.sort_unstable();
    let mut rows = Vec::new();
    for sampler in &args.sampler {
        for &points in &args.points {
            for &threads in &args.threads {
                for &precision in &precisions {
                    let setting = Setting { sampler, points, threads, precision };
                    rows.push(measure(args, model, &setting)?);
                }
            }
        }
    }
    let record = Record { machine: Machine::here(), model: model.display().to_string(), rows };
    if args.json {
        writeln!(stdout(), "{}", serde_json::to_string(&record)?)?;
        return Ok(());
    }
    let cells = |row: &Timing| {
        vec![
            ("sampler", row.sampler.clone()),
            ("precision", row.precision.to_owned()),
            ("kernel", row.kernel.to_owned()),
            ("from", row.from.to_string()),
            ("points", row.points.to_string()),
            ("threads", row.threads.to_string()),
            ("clouds", row.clouds.to_string()),
            ("p50 ms", format!("{:.3}", row.p50_ms)),
            ("p99 ms", format!("{:.3}", row.p99_ms)),
        ]
    };
    let (_, card) = open(model)?;
    let untrained = if card.trained { "" } else { ", untrained: its weights are random" };
    writeln!(stdout(), "{}{untrained}", record.model)?;
    table::print(3, &record.rows.iter().map(cells).collect::<Vec<_>>())?;
    Ok(())
}

fn measure(args: &BenchArgs, model: &Path, setting: &Setting<'_>) -> anyhow::Result<Timing> {
    let &Setting { sampler, points, threads, precision } = setting;
    let from = if sampler.takes_all() { points } else { args.from };
    let mut options =
        Options { precision, kernel: args.kernel, threads, capacity: from, ..Options::default() };
    sampler.set(&mut options, points);
    let mut classifier = Classifier::load(model, &options)?;
    let kernel = classifier.kernel().name();
    let cloud = cloud(from);
    // The first run warms up caches, pages and threads.
    classifier.classify(&cloud).context("classifying a random cloud")?;
    let samples_ms = if args.clouds == 1 {
        samples_ms(args.repeats, || Ok(black_box(classifier.classify(&cloud)).map(drop)?))?
    } else {
        let mut team = ClassifierTeam::new(classifier)?;
        samples_ms(args.repeats, || {
            let clouds = repeat_n((&cloud[..], None), args.clouds);
            let mut all = Ok(());
            team.classify_many(clouds, |answer| {
                if let Err(error) = black_box(answer) {
                    all = Err(anyhow::anyhow!(error.to_string()));
                }
            });
            all
        })?
    };
    Ok(Timing {
        sampler: sampler.to_string(),
        points,
        from,
        precision: precision.name(),
        threads,
        clouds: args.clouds,
        kernel,
        p50_ms: quantile(&samples_ms, 0.5),
        p99_ms: quantile(&samples_ms, 0.99),
        samples_ms,
    })
}

fn samples_ms(
    repeats: u32,
    mut classify: impl FnMut() -> anyhow::Result<()>,
) -> anyhow::Result<Vec<f64>> {
    let mut samples_ms = Vec::with_capacity(repeats as usize);
    for _ in 0..repeats {
        let start = Instant::now();
        classify()?;
        samples_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(samples_ms)
}

/// Random points in a cube, the same in every run.
fn cloud(n: usize) -> Vec<[f32; 3]> {
    let key = Stream::BenchmarkCloud {}.key(0);
    let unit = |i: usize| (2.0 * key.unit(i as u64) - 1.0) as f32;
    (0..n).map(|i| [unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)]).collect()
}

/// The `q` quantile of `samples` by the nearest rank; NaN without samples.
fn quantile(samples: &[f64], q: f64) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_samples() {
        let samples = [3.0, 1.0, 2.0, 4.0];
        assert_eq!([0.0, 0.5, 0.99, 1.0].map(|q| quantile(&samples, q)), [1.0, 2.0, 4.0, 4.0]);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
