//! Accuracy by the number of points; random, farthest and critical points, what they cost and how
//! accurate the networks behind them are.

use super::context::{ExperimentContext, Plan, sampler, test};
use super::page::Section;
use crate::render::chart::{Axis, Chart, Dot, Series};
use crate::render::table::{Cell, Table};
use formats::split::Split;
use infer_cpu::sampler::{Resize, Sampler, SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, kernel};
use std::time::Instant;
use train::clouds::Clouds;
use train::cpl::Cpl;
use train::recipe::{Recipe, Sampling};

const TIMED: usize = 64;

/// The name of the network behind front end `front` at `keep` points.
pub fn cpl_name(front: &[usize], keep: usize) -> String {
    format!("{}-{keep}", front_name(front))
}

fn front_name(front: &[usize]) -> String {
    let widths: Vec<String> = front.iter().map(ToString::to_string).collect();
    format!("cpl-3-{}", widths.join("-"))
}

/// Its recipe: the front end sees all points of the cloud.
fn cpl_recipe(plan: &Plan, n_points: usize, front: &[usize], keep: usize) -> Recipe {
    let cpl = Cpl { front: front.to_vec(), keep, ..Cpl::default() };
    Recipe { sampling: Sampling::First, cpl: Some(cpl), ..plan.at(n_points) }
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let held = context.clouds(Split::Test)?;
    let about = [
        format!(
            "Data: {}. CPL's networks are trained with it, end to end. The one that shares a \
             trunk has the input T-Net, the others have what the plan says.",
            context.clouds_are
        ),
        "Latency is the median over clouds on one thread of this machine, another than the \
         paper's; `cargo xtask bench pi-model` models a Raspberry Pi 5."
            .to_owned(),
    ];
    let tables = vec![
        ("4 accuracy", accuracy(context, &held)?),
        ("4 latency", latency(context, &held)?),
        ("4 unique", unique(context, &held)?),
        ("4 resize", resized(context, &held)?),
    ];
    Ok(Section::new("Samplers", about, tables))
}

/// A sampler, and the networks trained behind it: a name and a recipe for each count of
/// points in the plan's order, or for the first alone.
type Rival = (String, Vec<(String, Recipe)>);

fn rivals(plan: &Plan, n_points: usize) -> Vec<Rival> {
    let at_each_count = |network: &dyn Fn(usize) -> (String, Recipe)| {
        plan.kept.iter().map(|&keep| network(keep)).collect::<Vec<_>>()
    };
    let cpl = |front: &[usize], keep, change: &dyn Fn(&mut Cpl)| {
        let mut recipe = cpl_recipe(plan, n_points, front, keep);
        recipe.cpl.iter_mut().for_each(change);
        recipe
    };
    let random = at_each_count(&|keep| (random_name(keep), random_recipe(plan, keep)));
    let farthest = at_each_count(&|keep| {
        (format!("farthest-{keep}"), Recipe { sampling: Sampling::Fps, ..plan.at(keep) })
    });
    let mut rivals = vec![("random".to_owned(), random), ("farthest".to_owned(), farthest)];
    for front in &plan.fronts {
        let networks = at_each_count(&|keep| (cpl_name(front, keep), cpl(front, keep, &|_| {})));
        rivals.push((front_name(front), networks));
    }
    let keep = plan.kept[0];
    // Where a front end has more critical points than are kept, chance has a say.
    let front = &plan.fronts[plan.fronts.len().min(2) - 1];
    let gumbel = cpl(front, keep, &|cpl| cpl.gumbel = true);
    let network = (format!("{}-gumbel", cpl_name(front, keep)), gumbel);
    rivals.push((format!("{}, Gumbel-top-k", front_name(front)), vec![network]));
    let mut shared = cpl(&plan.fronts[0], keep, &|cpl| cpl.shared = true);
    shared.network.input_transform = true;
    let network = (format!("cpl-shared-{keep}"), shared);
    rivals.push(("cpl, trunk shared with the input T-Net".to_owned(), vec![network]));
    rivals
}

fn accuracy(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let train = context.clouds(Split::Train)?;
    let kept = &context.plan.kept;
    let title = "Instance accuracy, each network trained behind its sampler at that count";
    let mut table = Table::new(title, &["sampler"]);
    table.heading.extend(kept.iter().map(|n| format!("{n} points")));
    for (rival, networks) in rivals(&context.plan, train.set.smallest_cloud()) {
        let trained = |i: usize| {
            let Some((name, recipe)) = networks.get(i) else { return Ok(Cell::EMPTY) };
            let model = context.network(name, recipe.clone(), &train)?;
            Ok(Cell::instance(&test(&model, held, None)?))
        };
        table.measure(rival, (0..kept.len()).map(trained))?;
    }
    Ok(table)
}

fn latency(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let keep = context.plan.kept[0];
    let title = format!("Choosing {keep} of {} points, ms", held.set.smallest_cloud());
    let mut table = Table::new(title, &["sampler", "ms", "paper (1024 to 128)"]);
    let kernels = kernel::available().next().expect("invariant: scalar kernels run everywhere");
    for (name, kind, paper) in [
        ("random", SamplerKind::Random, Cell::EMPTY),
        ("farthest", SamplerKind::Fps, paper("5.73")),
    ] {
        let mut chosen = Sampler::new(sampler(kind, keep))?;
        let ms = median(held, |cloud| Ok(chosen.select(cloud, kernels)?.len()))?;
        table.measure(name, [Cell::Number(ms, 4), paper].map(Ok))?;
    }
    for front in &context.plan.fronts {
        let (name, mut classifier) = with_cpl(context, front, keep)?;
        let ms = median(held, |cloud| Ok(classifier.sample(&wide(cloud))?.len()))?;
        table.measure(name, [Cell::Number(ms, 4), paper("1.96")].map(Ok))?;
    }
    Ok(table)
}

/// The network behind front end `front`, by name, which keeps `points` points.
fn with_cpl(
    context: &ExperimentContext,
    front: &[usize],
    points: usize,
) -> anyhow::Result<(String, Classifier)> {
    let name = cpl_name(front, context.plan.kept[0]);
    let sampler = Some(sampler(SamplerKind::Cpl, points));
    let options = Options { sampler, ..Options::default() };
    let classifier = Classifier::load(&context.model(&name), &options)?;
    Ok((name, classifier))
}

fn paper(ms: &str) -> Cell {
    Cell::Text(format!("{ms}, Raspberry Pi 5"))
}

fn median(
    clouds: &Clouds,
    mut choose: impl FnMut(&[[f32; 3]]) -> anyhow::Result<usize>,
) -> anyhow::Result<f64> {
    let mut times = Vec::new();
    // The first few find caches and memory as they were.
    for i in (0..TIMED + 8).map(|i| i % clouds.len()) {
        let begun = Instant::now();
        std::hint::black_box(choose(clouds.set.cloud(i))?);
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    let times = &mut times[8..];
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// A cloud in f64.
pub fn wide(cloud: &[[f32; 3]]) -> Vec<[f64; 3]> {
    cloud.iter().map(|point| point.map(f64::from)).collect()
}

fn unique(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let title = "Distinct critical points of a cloud";
    let mut table = Table::new(title, &["front end", "least", "median", "most", "paper"]);
    for front in &context.plan.fronts {
        let (name, mut classifier) = with_cpl(context, front, held.set.smallest_cloud())?;
        let mut counts = Vec::new();
        for i in 0..held.len() {
            counts.push(classifier.sample(&wide(held.set.cloud(i)))?.len() as f64);
        }
        counts.sort_by(f64::total_cmp);
        let at = |i: usize| Cell::Number(counts[i], 0);
        let last = counts.len() - 1;
        let paper = Cell::Text("40 to 60".to_owned());
        table.measure(name, [at(0), at(last / 2), at(last), paper].map(Ok))?;
    }
    Ok(table)
}

/// Accuracy by the rule that resizes the critical points.
fn resized(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let keep = context.plan.kept[0];
    let rules = [Resize::Truncate, Resize::Cyclic, Resize::Nearest, Resize::Weighted];
    let title = format!("Instance accuracy by the rule that makes {keep} points of the ranking");
    let mut table = Table::new(title, &["front end"]);
    table.heading.extend(rules.map(|rule| rule.to_string()));
    for front in &context.plan.fronts {
        let name = cpl_name(front, keep);
        let model = context.model(&name);
        let tested = |resize| {
            let spec = SamplerSpec { resize, ..sampler(SamplerKind::Cpl, keep) };
            Ok(Cell::instance(&test(&model, held, Some(spec))?))
        };
        table.measure(name, rules.map(tested))?;
    }
    Ok(table)
}

fn random_name(n: usize) -> String {
    format!("random-{n}")
}

fn random_recipe(plan: &Plan, n: usize) -> Recipe {
    Recipe { sampling: Sampling::Random, ..plan.at(n) }
}

pub fn by_count(context: &ExperimentContext) -> anyhow::Result<Section> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let title = "Networks trained and tested at N points, drawn at random";
    let heading = ["points", "instance accuracy", "class accuracy", "paper"];
    let mut trained = Table::new(title, &heading);
    for &n in &context.plan.points {
        let model = context.network(&random_name(n), random_recipe(&context.plan, n), &train)?;
        let found = test(&model, &held, None)?;
        let cells = [Cell::instance(&found), Cell::class(&found), paper_accuracy(n)];
        trained.measure(n.to_string(), cells.map(Ok))?;
    }
    let most = context.plan.points.iter().copied().max().unwrap_or(1);
    let model = context.network(&random_name(most), random_recipe(&context.plan, most), &train)?;
    let title = format!("The network of {most} points, tested at others");
    let mut tested = Table::new(title, &["points", "random points", "farthest points"]);
    for &n in &context.plan.tested_points {
        let at = |kind| {
            if n > held.set.smallest_cloud() {
                return Ok(Cell::Text(format!("clouds have {} points", held.set.smallest_cloud())));
            }
            Ok(Cell::instance(&test(&model, &held, Some(sampler(kind, n)))?))
        };
        tested.measure(n.to_string(), [SamplerKind::Random, SamplerKind::Fps].map(at))?;
    }
    let chart = Chart {
        message: "Instance accuracy by the number of points".to_owned(),
        caption: "",
        x: Axis::Logarithmic("points"),
        y: Axis::Percent("instance accuracy"),
        series: vec![
            line("trained at N", &trained, 1),
            line(&format!("trained at {most}, random"), &tested, 1),
            line(&format!("trained at {most}, farthest"), &tested, 2),
        ],
    };
    let about = [
        format!("Data: {}.", context.clouds_are),
        "The first table has a network for each count; the second one network for all.".to_owned(),
    ];
    let title = "Accuracy by the number of points (table 1)";
    Ok(Section {
        drawings: vec![chart.figure().into_string()],
        ..Section::new(title, about, vec![("1 trained at N", trained), ("1 tested at N", tested)])
    })
}

/// The numbers of column `column` of `table`, whose rows are counts of points.
fn line(name: &str, table: &Table, column: usize) -> Series {
    let dot = |cells: &Vec<Cell>| {
        let (points, cell) = (cells[0].text(), &cells[column]);
        let (x, y) = (points.parse().ok()?, cell.numbers().0?);
        let tip = format!("{name}: {} of {points} points", cell.text());
        Some(Dot { x, y, tip, filled: true })
    };
    let dots = table.rows.iter().filter_map(dot).collect();
    Series { name: name.to_owned(), dots, joined: true }
}

fn paper_accuracy(n: usize) -> Cell {
    match n {
        64 => Cell::Text("89.01 % (random), 88.36 % (CPL)".to_owned()),
        _ => Cell::EMPTY,
    }
}
