//! What each shortcut gains in time and costs in accuracy.

use std::collections::{BTreeMap, HashMap};
use std::io::{Write, stderr};
use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail};
use formats::atomic;
use formats::interval::wilson;
use formats::labelled::{LabelledSet, read_labelled};
use infer_cpu::{Classifier, Precision};

use super::grid::{Setting, settings};
use super::statistics::quantile;
use super::{Args, plot, table};

/// One setting's figures on the whole set.
pub struct Row {
    /// The setting.
    pub setting: Setting,
    /// Median time of a classification.
    pub p50_ms: f64,
    /// The 99th percentile.
    pub p99_ms: f64,
    /// Clouds classified as labelled.
    pub n_right: usize,
    /// Clouds.
    pub n: usize,
    /// Share of clouds that fp32 classifies the same; 1 for fp32 itself.
    pub agreement: f64,
    /// The largest difference of a logit from fp32's.
    pub largest_error: f64,
    /// Whether no other setting is both faster and more accurate.
    pub on_front: bool,
}

impl Row {
    /// Share of clouds classified as labelled.
    pub fn accuracy(&self) -> f64 {
        self.n_right as f64 / self.n.max(1) as f64
    }
}

/// What one setting answered, cloud by cloud.
struct Answers {
    classes: Vec<usize>,
    logits: Vec<f32>,
    ms: Vec<f64>,
}

/// Measures every setting on the labelled set, prints, writes and draws it.
///
/// # Errors
/// A set or a model that cannot be read or do not fit, a file that cannot be
/// written.
pub fn run(args: &Args, model: &Path) -> anyhow::Result<()> {
    let Some(data) = &args.data else { bail!("--trade needs --data") };
    let set = read_labelled(data)?;
    if set.is_empty() {
        bail!("{}: no clouds", data.display());
    }
    let chosen = spread(set.len(), args.limit.map_or(usize::MAX, NonZeroUsize::get));
    let ranges = super::calibration(args, model)?;
    let mut references: HashMap<String, Answers> = HashMap::new();
    let mut rows = Vec::new();
    let settings: Vec<Setting> =
        settings(args).into_iter().filter(|setting| fits(setting, set.n_points)).collect();
    // What cannot be had is found before hours are spent on the rest.
    for setting in &settings {
        Classifier::load(model, &setting.options(args, set.n_points))
            .with_context(|| setting.sampler.to_string())?;
    }
    for setting in &settings {
        let (answers, labels) = answer(args, model, setting, &ranges, &set, &chosen)
            .with_context(|| format!("{} at {} points", setting.sampler, setting.points))?;
        let same = format!("{} {} {}", setting.sampler, setting.t_nets, setting.points);
        let reference = references.get(&same).unwrap_or(&answers);
        rows.push(row(setting, &answers, reference, &labels));
        if setting.precision == Precision::F32 {
            references.entry(same).or_insert(answers);
        }
        // Nobody may be reading; what was measured is worth more.
        let _ = write!(stderr(), "\r{} of {} settings", rows.len(), settings.len());
    }
    let _ = writeln!(stderr());
    mark_front(&mut rows);
    print(&rows)?;
    if let Some(path) = &args.csv {
        write_csv(path, &rows)?;
    }
    if let Some(path) = &args.svg {
        plot::write(path, &rows)?;
    }
    Ok(())
}

/// Whether clouds of `n_points` hold what `setting` asks for; if not, that is
/// said.
fn fits(setting: &Setting, n_points: usize) -> bool {
    let fits = setting.points <= n_points;
    if !fits {
        let Setting { sampler, points, .. } = setting;
        let _ = writeln!(stderr(), "left out {sampler} {points}: clouds of {n_points} points");
    }
    fits
}

/// `limit` of `n` indices, spread over all.
fn spread(n: usize, limit: usize) -> Vec<usize> {
    let kept = limit.min(n);
    (0..kept).map(|i| i * n / kept).collect()
}

/// The classifier's answers, and the labels by its own classes.
fn answer(
    args: &Args,
    model: &Path,
    setting: &Setting,
    ranges: &Option<BTreeMap<String, f32>>,
    set: &LabelledSet,
    chosen: &[usize],
) -> anyhow::Result<(Answers, Vec<usize>)> {
    let mut options = setting.options(args, set.n_points);
    options.activation_ranges.clone_from(ranges);
    let mut classifier = Classifier::load(model, &options)?;
    let labels = labels_by_model(&classifier, set, chosen)?;
    let mut answers = Answers { classes: Vec::new(), logits: Vec::new(), ms: Vec::new() };
    classifier.classify(set.cloud(chosen[0]))?;
    for &i in chosen {
        let cloud = set.cloud(i);
        // Without a sampler, the network sees the first points of each cloud.
        let cloud = match setting.sampler.takes_all() {
            true => &cloud[..setting.points.min(cloud.len())],
            false => cloud,
        };
        let start = Instant::now();
        let prediction = classifier.classify(cloud)?;
        answers.ms.push(start.elapsed().as_secs_f64() * 1e3);
        answers.classes.push(prediction.class);
        answers.logits.extend(&prediction.logits);
    }
    Ok((answers, labels))
}

/// The labels of the chosen clouds as indices into the model's classes, by
/// name where both know names.
fn labels_by_model(
    classifier: &Classifier,
    set: &LabelledSet,
    chosen: &[usize],
) -> anyhow::Result<Vec<usize>> {
    let labels = chosen.iter().map(|&i| set.labels[i]);
    let (Some(names), false) = (&set.classes, classifier.card().classes.is_empty()) else {
        return Ok(labels.collect());
    };
    let class = |label: usize| {
        let name = &names[label];
        classifier.classes().iter().position(|class| **class == **name).with_context(|| {
            format!("the model knows no class `{name}`, which the labelled set has")
        })
    };
    labels.map(class).collect()
}

fn row(setting: &Setting, answers: &Answers, reference: &Answers, labels: &[usize]) -> Row {
    let n = labels.len();
    let same = |a: &[usize], b: &[usize]| a.iter().zip(b).filter(|(a, b)| a == b).count();
    let errors = answers.logits.iter().zip(&reference.logits);
    let errors = errors.map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    Row {
        setting: setting.clone(),
        p50_ms: quantile(&answers.ms, 0.5),
        p99_ms: quantile(&answers.ms, 0.99),
        n_right: same(&answers.classes, labels),
        n,
        agreement: same(&answers.classes, &reference.classes) as f64 / n as f64,
        largest_error: errors.fold(0.0, f64::max),
        on_front: false,
    }
}

/// Marks the rows that no other dominates: none is at least as fast and as
/// accurate, and better in one of both.
fn mark_front(rows: &mut [Row]) {
    let figures: Vec<(f64, usize)> = rows.iter().map(|row| (row.p50_ms, row.n_right)).collect();
    for (row, &(ms, right)) in rows.iter_mut().zip(&figures) {
        row.on_front = !figures.iter().any(|&(other_ms, other_right)| {
            other_ms <= ms && other_right >= right && (other_ms < ms || other_right > right)
        });
    }
}

fn print(rows: &[Row]) -> anyhow::Result<()> {
    let header = [
        "sampler",
        "T-Nets",
        "precision",
        "points",
        "threads",
        "p50 ms",
        "p99 ms",
        "accuracy %",
        "95 % interval",
        "as f32 %",
        "largest error",
        "front",
    ];
    let cells = |row: &Row| {
        let (low, high) = wilson(row.n_right, row.n);
        vec![
            row.setting.sampler.to_string(),
            row.setting.t_nets.to_string(),
            row.setting.precision.to_string(),
            row.setting.points.to_string(),
            row.setting.threads.to_string(),
            format!("{:.3}", row.p50_ms),
            format!("{:.3}", row.p99_ms),
            format!("{:.2}", 100.0 * row.accuracy()),
            format!("{:.2} to {:.2}", 100.0 * low, 100.0 * high),
            format!("{:.2}", 100.0 * row.agreement),
            format!("{:.1e}", row.largest_error),
            if row.on_front { "*" } else { "" }.to_owned(),
        ]
    };
    table::print(&header, 3, &rows.iter().map(cells).collect::<Vec<_>>())?;
    Ok(())
}

fn write_csv(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    atomic::write(path, |out| {
        writeln!(
            out,
            "sampler,t_nets,precision,points,threads,p50_ms,p99_ms,right,clouds,accuracy,\
             interval_low,interval_high,agreement_with_f32,largest_logit_error,on_front"
        )?;
        for row in rows {
            let Setting { sampler, t_nets, precision, points, threads } = &row.setting;
            let (low, high) = wilson(row.n_right, row.n);
            writeln!(
                out,
                "{sampler},{t_nets},{precision},{points},{threads},{:.4},{:.4},{},{},{:.5},{low:.5},\
                 {high:.5},{:.5},{:.3e},{}",
                row.p50_ms,
                row.p99_ms,
                row.n_right,
                row.n,
                row.accuracy(),
                row.agreement,
                row.largest_error,
                row.on_front,
            )?;
        }
        Ok(())
    })?;
    Ok(())
}
