//! `cargo xtask bench robustness`: networks for whole objects on strays, turns, few points and
//! negatives, each with and without the outlier filter, and the cost of the filter.

use crate::measure::clock::{Workload, interleave, workload};
use crate::render::table::{Table, percent, publish};
use anyhow::{Result, bail};
use clap::Args;
use formats::labelled::LabelledSet;
use formats::rng::StreamKey;
use formats::split::Split;
use infer_cpu::sampler::OutlierFilter;
use infer_cpu::{Classifier, ModelCard, Normalization, Options};
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::negatives::{Negative, negative};
use train::object_report::{Labels, Object, classified};

#[derive(Args, Debug)]
pub struct RobustnessArgs {
    /// Models for whole objects, in the unit sphere (repeat the flag).
    #[arg(long, value_name = "FILE", required = true)]
    model: Vec<PathBuf>,
    /// Labelled clouds of objects, z up, or data with a test part as `train --data` takes it.
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Seed of all that is drawn here; no training uses its streams' names.
const SEED: u64 = 0;
const NEGATIVES: usize = 300;
/// Strays lie in the cube of this half edge around the unit sphere's centre.
const STRAY_REACH: f64 = 1.5;
/// Points that are left of a sparse cloud: the first, since data are in random order.
const FEW: usize = 100;
/// Repeats of each timing, and clouds that one repeat classifies.
const ROUNDS: usize = 9;
const TIMED: usize = 50;
const SIZES: [usize; 4] = [100, 1024, 32_768, 1_000_000];

pub fn run(args: &RobustnessArgs) -> Result<()> {
    let clouds = Clouds::read(&args.data, Split::Test, usize::MAX)?;
    let inputs = inputs(&clouds);
    let mut tables = Vec::new();
    for model in &args.model {
        tables.push(answers(model, &clouds, &inputs)?);
    }
    tables.push(cost_in_classifier(&args.model, &clouds)?);
    tables.push(cost_alone(&clouds)?);
    publish(&tables, args.report.as_deref())
}

struct Input {
    name: String,
    set: LabelledSet,
    /// Whether its clouds are no objects, whose right answer is `unknown`.
    is_negative: bool,
}

fn inputs(clouds: &Clouds) -> Vec<Input> {
    let mut inputs = vec![changed("as they are", clouds, |_, cloud| cloud.to_vec())];
    for n in [1, 3, 10] {
        let with_strays = |i, cloud: &[[f32; 3]]| [cloud, &strays(n, i)[..]].concat();
        inputs.push(changed(&format!("beside {n} strays"), clouds, with_strays));
    }
    for degrees in [15.0f64, 45.0] {
        let name = format!("turned by {degrees} degrees");
        inputs.push(changed(&name, clouds, |_, cloud| turned(cloud, degrees.to_radians())));
    }
    let any = |i| std::f64::consts::TAU * StreamKey::new(SEED, "yaw", i).unit(0);
    inputs.push(changed("turned by any angle", clouds, |i, cloud| turned(cloud, any(i))));
    inputs.push(changed(&format!("{FEW} points"), clouds, |_, cloud| cloud[..FEW].to_vec()));
    inputs.push(changed(&format!("{FEW} points, any angle, 3 strays"), clouds, |i, cloud| {
        [turned(&cloud[..FEW], any(i)), strays(3, i)].concat()
    }));
    for kind in Negative::ALL {
        let made = |i| negative(kind, clouds, StreamKey::new(SEED, &format!("study {kind}"), i));
        inputs.push(negatives(&format!("negatives: {kind}"), made));
    }
    // A kind that no training makes.
    inputs.push(negatives("negatives: corner of two walls and a floor", corner));
    inputs
}

fn changed(
    name: &str,
    clouds: &Clouds,
    change: impl Fn(u32, &[[f32; 3]]) -> Vec<[f32; 3]>,
) -> Input {
    let mut set = LabelledSet::default();
    for i in 0..clouds.len() {
        set.push(&change(i as u32, clouds.set.cloud(i)), clouds.set.labels[i]);
    }
    Input { name: name.to_owned(), set, is_negative: false }
}

fn negatives(name: &str, make: impl Fn(u32) -> Vec<[f32; 3]>) -> Input {
    let mut set = LabelledSet::default();
    (0..NEGATIVES as u32).for_each(|i| set.push(&make(i), 0));
    Input { name: name.to_owned(), set, is_negative: true }
}

fn strays(n: usize, cloud: u32) -> Vec<[f32; 3]> {
    let key = StreamKey::new(SEED, &format!("{n} strays"), cloud);
    let along = |i: usize| (STRAY_REACH * (2.0 * key.unit(i as u64) - 1.0)) as f32;
    (0..n).map(|i| [0, 1, 2].map(|axis| along(3 * i + axis))).collect()
}

fn turned(cloud: &[[f32; 3]], angle: f64) -> Vec<[f32; 3]> {
    let (sin, cos) = (angle.sin() as f32, angle.cos() as f32);
    cloud.iter().map(|[x, y, z]| [cos * x - sin * y, sin * x + cos * y, *z]).collect()
}

fn corner(i: u32) -> Vec<[f32; 3]> {
    let key = StreamKey::new(SEED, "study corner", i);
    let height = 0.5 + key.unit(0);
    let point = |n: u64| {
        let mut point = [key.unit(2 * n), key.unit(2 * n + 1), 0.0];
        point.rotate_right(n as usize % 3);
        [point[0] as f32, point[1] as f32, (height * point[2]) as f32]
    };
    turned(&(1..=1024).map(point).collect::<Vec<_>>(), std::f64::consts::TAU * key.unit(1))
}

fn filter(is_on: bool) -> Options {
    Options { outlier_filter: Some(is_on), ..Options::default() }
}

fn answers(path: &Path, clouds: &Clouds, inputs: &[Input]) -> Result<Table> {
    let card = ModelCard::read(path)?;
    if card.normalization != Normalization::UnitSphere || !card.classes.starts_with(&clouds.classes)
    {
        let (found, expected) = (&card.classes, &clouds.classes);
        bail!(
            "{}: expected clouds in the unit sphere and first the classes {expected:?}, found {} and \
             {found:?}",
            path.display(),
            card.normalization
        );
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let shipped = if card.outlier_filter { "on" } else { "off" };
    let title =
        format!("{name}: right answers of {} objects, filter {shipped} by its card", clouds.len());
    let heading = ["input", "filter off, %", "filter on, %", "called unknown, filter on, %"];
    let mut table = Table::new(title, &heading);
    let labels = Labels::new(&card.classes, &[]);
    for Input { name, set, is_negative } in inputs {
        let own = || clouds.classes.clone();
        let classes = if *is_negative { vec!["negative".to_owned()] } else { own() };
        let one = Clouds { set: set.clone(), classes };
        let scored = |is_on| classified(path, "", &one, (&labels, 0), &filter(is_on));
        let (off, on) = (scored(false)?, scored(true)?);
        let share = |found: &[Object], is_counted: fn(&Object) -> bool| {
            percent(
                found.iter().filter(|object| is_counted(object)).count() as f64 / set.len() as f64,
            )
        };
        let rights = [&off, &on].map(|found| share(found, Object::is_right));
        let unknown = share(&on, |object| object.answer.class.is_none());
        table.push([vec![name.clone()], rights.into(), vec![unknown]].concat());
    }
    Ok(table)
}

fn cost_in_classifier(models: &[PathBuf], clouds: &Clouds) -> Result<Table> {
    let heading = ["model", "filter off, µs", "filter on, µs"];
    let mut table = Table::new("CPU time of a classification, f32, one thread", &heading);
    let n = TIMED.min(clouds.len());
    for model in models {
        let mut workloads: Vec<Workload<'_>> = Vec::new();
        for is_on in [false, true] {
            let mut classifier = Classifier::load(model, &filter(is_on))?;
            workloads.push(workload(move || {
                (0..n).try_for_each(|i| classifier.classify(clouds.set.cloud(i)).map(|_| ()))?;
                Ok(())
            }));
        }
        let name = model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let times = micros(&mut workloads, n)?;
        table.push([vec![name], times].concat());
    }
    Ok(table)
}

fn cost_alone(clouds: &Clouds) -> Result<Table> {
    let mut table = Table::new("CPU time of the filter alone", &["points", "µs"]);
    for size in SIZES {
        let key = StreamKey::new(SEED, "study thickened", size as u32);
        let cloud = clouds.set.cloud(0);
        // As many as are asked for, none twice.
        let point = |i: usize| {
            let near = |axis: usize| (0.02 * key.unit((3 * i + axis) as u64)) as f32;
            [0, 1, 2].map(|axis| cloud[i % cloud.len()][axis] + near(axis))
        };
        let points: Vec<[f32; 3]> = (0..size).map(point).collect();
        let mut filter = OutlierFilter::default();
        let repeats = (100_000 / size).max(1);
        let find = workload(move || Ok((0..repeats).map(|_| filter.find(&points)).sum::<usize>()));
        table.push([vec![size.to_string()], micros(&mut [find], repeats)?].concat());
    }
    Ok(table)
}

/// Microseconds of each of `workloads`, that do `n` things each.
fn micros(workloads: &mut [Workload<'_>], n: usize) -> Result<Vec<String>> {
    let costs = interleave(ROUNDS, workloads)?;
    Ok(costs.iter().map(|costs| format!("{:.0}", 1e6 * costs.cpu_s().median / n as f64)).collect())
}
