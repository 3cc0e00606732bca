//! The experiments: a table each, of instance accuracies with their 95 % intervals.

use super::super::resume;
use super::context::{ExperimentContext, Plan};
use crate::table::{Table, percent};
use anyhow::{Result, ensure};
use formats::interval::wilson;
use formats::split::Split;
use infer_cpu::Options;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use train::clouds::Clouds;
use train::cpl::Cpl;
use train::evaluate::confusion;
use train::recipe::{Recipe, Sampling, Schedule};

type Experiment = fn(&ExperimentContext) -> Result<Table>;

pub const EXPERIMENTS: [Experiment; 5] = [trained_at, tested_at, samplers, matrix, origins];

/// The accuracy of `model` on `clouds`, behind `sampler` or as trained.
fn accuracy(model: &Path, clouds: &Clouds, sampler: Option<SamplerSpec>) -> Result<String> {
    let found = confusion(model, clouds, &Options { sampler, ..Options::default() })?;
    let (right, n) = (found.correct(), found.total());
    let (low, high) = wilson(right, n);
    let share = percent(right as f64 / n.max(1) as f64);
    Ok(format!("{share} % ({} to {})", percent(low), percent(high)))
}

/// A network that experiments test.
pub struct Network {
    pub name: String,
    pub out: PathBuf,
    pub recipe: Recipe,
    pub clouds: Arc<Clouds>,
}

impl Network {
    fn new(context: &ExperimentContext, name: String, recipe: Recipe, clouds: Arc<Clouds>) -> Self {
        Self { out: context.model(&name), name, recipe, clouds }
    }

    /// Trains the network, unless it is there: trained by an earlier run, or elsewhere.
    pub fn train(self) -> Result<()> {
        if self.out.is_file() && !resume::recipe_file(&self.out).is_file() {
            return self.check_card();
        }
        resume::network(&self.out, &self.name, self.recipe, &self.clouds)
    }

    /// Checks that a network that was trained elsewhere is the one that is wanted.
    fn check_card(&self) -> Result<()> {
        let (_, card) = infer_cpu::model_file::open(&self.out)?;
        let points = self.recipe.cpl.as_ref().map_or(self.recipe.points, |cpl| cpl.keep);
        let found = (card.training_set.as_deref(), card.points, &card.classes);
        let wanted = (Some(self.name.as_str()), Some(points), &self.clouds.classes);
        ensure!(
            found == wanted,
            "{}: expected a training set, points and classes {wanted:?}, found {found:?}",
            self.out.display()
        );
        Ok(())
    }
}

/// All networks. Those that take longest come first, so that none is trained alone at the end.
pub fn networks(context: &ExperimentContext) -> Result<Vec<Network>> {
    let (plan, clouds) = (&context.plan, context.clouds(Split::Train)?);
    let behind_samplers = rivals(plan, clouds.set.smallest_cloud()).into_iter();
    let of_clouds = plan.points.iter().map(|&n| random(plan, n));
    let of_clouds = of_clouds.chain(behind_samplers.flat_map(|(_, networks)| networks));
    let network = |(name, recipe)| Network::new(context, name, recipe, Arc::clone(&clouds));
    let of_clouds = of_clouds.map(|named| Ok(network(named)));
    let of_scans = SETS.iter().map(|(_, place)| of_set(context, place));
    let mut networks = of_clouds.chain(of_scans).collect::<Result<Vec<_>>>()?;
    let mut names = BTreeSet::new();
    networks.retain(|network| names.insert(network.name.clone()));
    networks.sort_by_key(|Network { recipe, clouds, .. }| {
        Reverse(recipe.points * recipe.epochs as usize * clouds.len())
    });
    Ok(networks)
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
    let held = context.clouds(Split::Test)?;
    let title = "Networks trained and tested at N points, drawn at random";
    let mut table = Table::new(title, &["points", "accuracy", "paper"]);
    for &n in &context.plan.points {
        let model = context.model(&random(&context.plan, n).0);
        let paper = if n == 64 { "89.01 % (random), 88.36 % (CPL)" } else { "" };
        let cells = [accuracy(&model, &held, None), Ok(paper.to_owned())];
        push(&mut table, n.to_string(), cells)?;
    }
    Ok(table)
}

fn tested_at(context: &ExperimentContext) -> Result<Table> {
    let held = context.clouds(Split::Test)?;
    let most = context.plan.points.iter().copied().max().unwrap_or(1);
    let model = context.model(&random(&context.plan, most).0);
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
/// points in the plan's order.
type Rival = (String, Vec<(String, Recipe)>);

fn rivals(plan: &Plan, n_points: usize) -> Vec<Rival> {
    let at_each_count = |network: &dyn Fn(usize) -> (String, Recipe)| {
        plan.kept.iter().map(|&keep| network(keep)).collect::<Vec<_>>()
    };
    let farthest =
        |keep| (format!("farthest-{keep}"), Recipe { sampling: Sampling::Fps, ..plan.at(keep) });
    let mut rivals = vec![
        ("random".to_owned(), at_each_count(&|keep| random(plan, keep))),
        ("farthest".to_owned(), at_each_count(&farthest)),
    ];
    for front in &plan.fronts {
        let widths: Vec<String> = front.iter().map(ToString::to_string).collect();
        let name = format!("cpl-3-{}", widths.join("-"));
        // The front end sees all points of the cloud.
        let network = |keep| {
            let cpl = Some(Cpl { front: front.clone(), keep, ..Cpl::default() });
            let recipe = Recipe { sampling: Sampling::First, cpl, ..plan.at(n_points) };
            (format!("{name}-{keep}"), recipe)
        };
        rivals.push((name.clone(), at_each_count(&network)));
    }
    rivals
}

fn samplers(context: &ExperimentContext) -> Result<Table> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let title = "Networks trained behind each sampler, by the points that it keeps";
    let mut table = Table::new(title, &["sampler"]);
    table.heading.extend(context.plan.kept.iter().map(|n| format!("{n} points")));
    for (rival, networks) in rivals(&context.plan, train.set.smallest_cloud()) {
        let trained = |(name, _): &(String, Recipe)| accuracy(&context.model(name), &held, None);
        push(&mut table, rival, networks.iter().map(trained))?;
    }
    Ok(table)
}

/// Clouds of the same meshes, and where they lie. The static scanner is BLAINDER's example.
const SETS: [(&str, &str); 7] = [
    ("uniform samples", "surfaces/surface"),
    ("static clean", "static/packed/static-clean"),
    ("static noisy", "static/packed/static-noisy"),
    ("BLAINDER rotational clean", "blainder/packed/rotational-clean"),
    ("BLAINDER rotational noisy", "blainder/packed/rotational-noisy"),
    ("VLP-32C clean", "vlp32c/packed/rotational-clean"),
    ("VLP-32C noisy", "vlp32c/packed/rotational-noisy"),
];

/// The network of each of the sets, tested on all of them.
fn matrix(context: &ExperimentContext) -> Result<Table> {
    let title = "Datasets of the same meshes; a row is trained on one";
    let mut table = Table::new(title, &["trained"]);
    table.heading.extend(SETS.iter().map(|(name, _)| format!("tested: {name}")));
    for (name, place) in SETS {
        let model = context.model(&name_of(place));
        let tested = |(_, place): &(&str, &str)| {
            accuracy(&model, &*context.scans(place, Split::Test)?, None)
        };
        push(&mut table, name, SETS.iter().map(tested))?;
    }
    Ok(table)
}

/// What the cards of the networks say about who trained them.
fn origins(context: &ExperimentContext) -> Result<Table> {
    let mut table = Table::new("Who trained each network", &["network", "origin"]);
    for Network { name, out, .. } in networks(context)? {
        let (_, card) = infer_cpu::model_file::open(&out)?;
        table.push(vec![name, card.provenance.unwrap_or_else(|| "not stated".to_owned())]);
    }
    Ok(table)
}

/// The network of the set at `place`, trained for the fewest epochs that have the plan's steps. The
/// steps of the schedule are longer by as much as the run, so that the rate falls at the same shares of
/// it.
fn of_set(context: &ExperimentContext, place: &str) -> Result<Network> {
    let (plan, clouds) = (&context.plan, context.scans(place, Split::Train)?);
    let recipe = Recipe { sampling: Sampling::Random, ..plan.at(plan.mesh_points) };
    let steps_an_epoch = (clouds.len() / recipe.batch).max(1) as u32;
    let epochs = plan.mesh_steps.div_ceil(steps_an_epoch).max(1);
    let schedule = stretched(recipe.schedule, f64::from(epochs) / f64::from(recipe.epochs));
    Ok(Network::new(context, name_of(place), Recipe { epochs, schedule, ..recipe }, clouds))
}

/// `schedule` for a run that is `ratio` times as long.
pub fn stretched(schedule: Schedule, ratio: f64) -> Schedule {
    match schedule {
        Schedule::Step { every, factor } => {
            let every = (f64::from(every) * ratio).round().max(1.0) as u32;
            Schedule::Step { every, factor }
        }
        Schedule::Cosine { warm_up, last } => Schedule::Cosine { warm_up: warm_up * ratio, last },
    }
}

/// The name of the network of the set at `place`.
fn name_of(place: &str) -> String {
    format!("on-{}", place.replace('/', "-"))
}
