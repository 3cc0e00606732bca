//! Random, farthest and critical points: what they cost and what they are
//! worth, each behind a network trained at the same count.

use std::time::Instant;

use formats::split::Split;
use infer_cpu::sampler::{Resize, Sampler, SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, kernel};
use train::clouds::Clouds;
use train::cpl::Cpl;
use train::recipe::{Recipe, Sampling};

use super::context::{ExperimentContext, sampler, test};
use super::plan::Plan;
use super::points;
use super::section::{Cell, Section, Table};

/// Clouds whose sampling is timed.
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
        accuracy(context, &held)?,
        latency(context, &held)?,
        unique(context, &held)?,
        resized(context, &held)?,
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
    let random = at_each_count(&|keep| (points::name(keep), points::recipe(plan, keep)));
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
    let mut table = Table::new(
        "4 accuracy",
        "Instance accuracy, each network trained behind its sampler at that count",
        "sampler",
        kept.iter().map(|n| format!("{n} points")),
    );
    for (rival, networks) in rivals(&context.plan, train.set.smallest_cloud()) {
        let trained = |i: usize| {
            let Some((name, recipe)) = networks.get(i) else { return Ok(Cell::None) };
            let model = context.network(name, recipe.clone(), &train)?;
            Ok(Cell::instance(&test(&model, held, None)?))
        };
        table.measure(rival, (0..kept.len()).map(trained))?;
    }
    Ok(table)
}

fn latency(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let keep = context.plan.kept[0];
    let caption = format!("Choosing {keep} of {} points, ms", held.set.smallest_cloud());
    let mut table = Table::new("4 latency", caption, "sampler", ["ms", "paper (1024 to 128)"]);
    let kernels = kernel::available().next().expect("invariant: scalar kernels run everywhere");
    for (name, kind, paper) in
        [("random", SamplerKind::Random, Cell::None), ("farthest", SamplerKind::Fps, paper("5.73"))]
    {
        let mut chosen = Sampler::new(sampler(kind, keep))?;
        let ms = median(held, |cloud| Ok(chosen.select(cloud, kernels)?.len()))?;
        table.push(name, [Cell::Number(ms, 4), paper]);
    }
    for front in &context.plan.fronts {
        let (name, mut classifier) = with_cpl(context, front, keep)?;
        let ms = median(held, |cloud| Ok(classifier.sample(&wide(cloud))?.len()))?;
        table.push(name, [Cell::Number(ms, 4), paper("1.96")]);
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

/// The median time of `choose` over some clouds, ms.
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
    let caption = "Distinct critical points of a cloud";
    let columns = ["least", "median", "most", "paper"];
    let mut table = Table::new("4 unique", caption, "front end", columns);
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
        table.push(name, [at(0), at(last / 2), at(last), paper]);
    }
    Ok(table)
}

/// Accuracy by how critical points are made as many as are wanted.
fn resized(context: &ExperimentContext, held: &Clouds) -> anyhow::Result<Table> {
    let keep = context.plan.kept[0];
    let rules = [Resize::Truncate, Resize::Cyclic, Resize::Nearest, Resize::Weighted];
    let caption = format!("Instance accuracy by the rule that makes {keep} points of the ranking");
    let columns = rules.map(|rule| rule.to_string());
    let mut table = Table::new("4 resize", caption, "front end", columns);
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
