//! The experiments: a table each, of instance accuracies with their 95 % intervals.

use super::context::{ExperimentContext, Plan};
use crate::table::{Table, percent};
use anyhow::Result;
use formats::interval::wilson;
use formats::split::Split;
use infer_cpu::Options;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::cpl::Cpl;
use train::evaluate::confusion;
use train::recipe::{Recipe, Sampling};

type Experiment = fn(&ExperimentContext) -> Result<Table>;

/// The order lets each experiment find the networks that it shares with earlier ones.
pub const EXPERIMENTS: [Experiment; 5] = [trained_at, tested_at, matrix, samplers, noise];

/// The accuracy of `model` on `clouds`, behind `sampler` or as trained.
fn accuracy(model: &Path, clouds: &Clouds, sampler: Option<SamplerSpec>) -> Result<String> {
    let found = confusion(model, clouds, &Options { sampler, ..Options::default() })?;
    let (right, n) = (found.correct(), found.total());
    let (low, high) = wilson(right, n);
    let share = percent(right as f64 / n.max(1) as f64);
    Ok(format!("{share} % ({} to {})", percent(low), percent(high)))
}

/// Adds the row `name` of cells that are measured one after another.
fn push(
    table: &mut Table,
    name: impl Into<String>,
    cells: impl IntoIterator<Item = Result<String>>,
) -> Result<()> {
    let cells = std::iter::once(Ok(name.into())).chain(cells);
    table.push(cells.collect::<Result<_>>()?);
    Ok(())
}

/// The name and the recipe of the network of `n` random points.
fn random(plan: &Plan, n: usize) -> (String, Recipe) {
    (format!("random-{n}"), Recipe { sampling: Sampling::Random, ..plan.at(n) })
}

fn trained_at(context: &ExperimentContext) -> Result<Table> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let title = "Networks trained and tested at N points, drawn at random";
    let mut table = Table::new(title, &["points", "accuracy", "paper"]);
    for &n in &context.plan.points {
        let (name, recipe) = random(&context.plan, n);
        let model = context.network(&name, recipe, &train)?;
        let paper = if n == 64 { "89.01 % (random), 88.36 % (CPL)" } else { "" };
        let cells = [accuracy(&model, &held, None), Ok(paper.to_owned())];
        push(&mut table, n.to_string(), cells)?;
    }
    Ok(table)
}

fn tested_at(context: &ExperimentContext) -> Result<Table> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let most = context.plan.points.iter().copied().max().unwrap_or(1);
    let (name, recipe) = random(&context.plan, most);
    let model = context.network(&name, recipe, &train)?;
    let title = format!("The network of {most} points, tested at others");
    let mut table = Table::new(title, &["points", "random points", "farthest points"]);
    let largest = held.set.smallest_cloud();
    for &points in context.plan.tested_points.iter().filter(|&&n| n <= largest) {
        let at = |kind| {
            let sampler = SamplerSpec { kind, points, ..SamplerSpec::default() };
            accuracy(&model, &held, Some(sampler))
        };
        push(&mut table, points.to_string(), [SamplerKind::Random, SamplerKind::Fps].map(at))?;
    }
    Ok(table)
}

/// A sampler, and the networks trained behind it: a name and a recipe for each count of
/// points in the plan's order, or for the first alone.
type Rival = (String, Vec<(String, Recipe)>);

fn rivals(plan: &Plan, n_points: usize) -> Vec<Rival> {
    let at_each_count = |network: &dyn Fn(usize) -> (String, Recipe)| {
        plan.kept.iter().map(|&keep| network(keep)).collect::<Vec<_>>()
    };
    // The front end sees all points of the cloud.
    let cpl = |front: &[usize], keep, change: &dyn Fn(&mut Cpl)| {
        let mut cpl = Cpl { front: front.to_vec(), keep, ..Cpl::default() };
        change(&mut cpl);
        Recipe { sampling: Sampling::First, cpl: Some(cpl), ..plan.at(n_points) }
    };
    let name = |front: &[usize]| {
        let widths: Vec<String> = front.iter().map(ToString::to_string).collect();
        format!("cpl-3-{}", widths.join("-"))
    };
    let farthest =
        |keep| (format!("farthest-{keep}"), Recipe { sampling: Sampling::Fps, ..plan.at(keep) });
    let mut rivals = vec![
        ("random".to_owned(), at_each_count(&|keep| random(plan, keep))),
        ("farthest".to_owned(), at_each_count(&farthest)),
    ];
    for front in &plan.fronts {
        let network = |keep| (format!("{}-{keep}", name(front)), cpl(front, keep, &|_| {}));
        rivals.push((name(front), at_each_count(&network)));
    }
    let keep = plan.kept[0];
    // Where a front end has more critical points than are kept, chance has a say.
    let front = &plan.fronts[plan.fronts.len().min(2) - 1];
    let gumbel = cpl(front, keep, &|cpl| cpl.gumbel = true);
    let network = (format!("{}-{keep}-gumbel", name(front)), gumbel);
    rivals.push((format!("{}, Gumbel-top-k", name(front)), vec![network]));
    let mut shared = cpl(&plan.fronts[0], keep, &|cpl| cpl.shared = true);
    shared.network.input_transform = true;
    let network = (format!("cpl-shared-{keep}"), shared);
    rivals.push(("cpl, trunk shared with the input T-Net".to_owned(), vec![network]));
    rivals
}

fn samplers(context: &ExperimentContext) -> Result<Table> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let kept = &context.plan.kept;
    let title = "Networks trained behind each sampler, by the points that it keeps";
    let mut table = Table::new(title, &["sampler"]);
    table.heading.extend(kept.iter().map(|n| format!("{n} points")));
    for (rival, networks) in rivals(&context.plan, train.set.smallest_cloud()) {
        let trained = |i: usize| {
            let Some((name, recipe)) = networks.get(i) else { return Ok(String::new()) };
            accuracy(&context.network(name, recipe.clone(), &train)?, &held, None)
        };
        push(&mut table, rival, (0..kept.len()).map(trained))?;
    }
    Ok(table)
}

const NOISY: &str = "lidar/packed/rotational-noisy";

fn matrix(context: &ExperimentContext) -> Result<Table> {
    let sets = [
        ("uniform samples", "surfaces/surface"),
        ("static clean", "lidar/packed/static-clean"),
        ("static noisy", "lidar/packed/static-noisy"),
        ("rotational clean", "lidar/packed/rotational-clean"),
        ("rotational noisy", NOISY),
    ];
    each_on_each(context, "Five datasets of the same meshes; a row is trained on one", &sets)
}

fn noise(context: &ExperimentContext) -> Result<Table> {
    let sets = [
        ("0 m", "lidar/packed/rotational-clean"),
        ("0.01 m", NOISY),
        ("0.02 m", "noise-0.02/packed/rotational-noisy"),
        ("0.05 m", "noise-0.05/packed/rotational-noisy"),
        ("0.1 m", "noise-0.1/packed/rotational-noisy"),
    ];
    each_on_each(context, "Noise along the ray; a row is trained with one", &sets)
}

/// The network of each of `sets`, names and places, tested on all of them.
fn each_on_each(context: &ExperimentContext, title: &str, sets: &[(&str, &str)]) -> Result<Table> {
    let mut table = Table::new(title, &["trained"]);
    table.heading.extend(sets.iter().map(|(name, _)| format!("tested: {name}")));
    for (name, place) in sets {
        let model = of_set(context, place)?;
        let tested = |(_, place): &(&str, &str)| {
            accuracy(&model, &*context.scans(place, Split::Test)?, None)
        };
        push(&mut table, *name, sets.iter().map(tested))?;
    }
    Ok(table)
}

/// The network of the set at `place`, trained for the fewest epochs that have the plan's steps.
fn of_set(context: &ExperimentContext, place: &str) -> Result<PathBuf> {
    let (plan, clouds) = (&context.plan, context.scans(place, Split::Train)?);
    let recipe = Recipe { sampling: Sampling::Random, ..plan.at(plan.mesh_points) };
    let steps_an_epoch = (clouds.len() / recipe.batch).max(1) as u32;
    let epochs = plan.mesh_steps.div_ceil(steps_an_epoch).max(1);
    let name = format!("on-{}", place.replace('/', "-"));
    context.network(&name, Recipe { epochs, ..recipe }, &clouds)
}
