//! `cargo xtask ablate`: how much each effect of a scan matters to a classifier, and its cost.
//!
//! A plan lists rows, each of which changes something. For each row and seed a network learns
//! from the row's clouds. It is tested on the clouds of the row that it is compared with, on its
//! own, and on the set that all networks are compared on; the other row's network is tested on
//! this row's clouds, too. [`objects`] are scans of meshes, [`streets`] clusters of street scenes.

mod objects;
mod streets;

use super::{plan as plans, resume};
use crate::measure::clock::{Spread, Workload, interleave};
use crate::render::table::{Table, digits, percent};
use anyhow::{Context, ensure};
use edgepuck_program::Outcome;
use formats::atomic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::recipe::Recipe;

#[derive(clap::Subcommand)]
pub enum Ablation {
    /// Compare scans of meshes: noise, beams, occlusion
    Objects(objects::ObjectsArgs),
    /// Compare street scenes: weather, materials, returns, on simulated and on real objects
    Streets(streets::StreetsArgs),
}

/// The plan, and the folder for everything that a study makes.
#[derive(clap::Args)]
struct StudyArgs {
    /// Use only a few meshes or scenes; this takes two minutes
    #[arg(long, conflicts_with = "plan")]
    quick: bool,

    /// Plan of the study, a TOML file like those in assets/ablations
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,

    /// Folder for the results (ablations.csv or street.csv, and a table in Markdown) and all
    /// intermediate files; an interrupted run is resumed
    #[arg(long, value_name = "DIR", default_value = "data/ablations")]
    out: PathBuf,
}

impl StudyArgs {
    fn plan<P: plans::Plan>(&self) -> anyhow::Result<P> {
        plans::read(self.plan.as_deref(), self.quick)
    }
}

/// Makes the missing datasets, networks and answers, prints the table and writes it with the
/// answers.
pub fn run(ablation: &Ablation) -> anyhow::Result<Outcome> {
    match ablation {
        Ablation::Objects(args) => objects::run(args),
        Ablation::Streets(args) => streets::run(args),
    }
}

/// The clouds, networks and scores of the rows of a plan.
trait Study {
    const NAME: &'static str;

    fn seeds(&self) -> &[u64];

    fn rows(&self) -> Vec<&str>;

    fn beside(&self, _row: usize) -> usize {
        0
    }

    fn goal(&self) -> &str;

    /// The recipe and the training clouds of the network of `row`.
    fn lesson(&self, row: usize, seed: u64) -> anyhow::Result<(Recipe, Clouds)>;

    /// The right answers by class of `network` on the set `tested_on`, a row or the goal.
    fn scores(
        &self,
        network: &Network<'_>,
        tested_on: &str,
        seed: u64,
    ) -> anyhow::Result<Vec<Score>>;

    /// Rounds in which the time of each row is measured.
    fn cost_rounds(&self) -> usize;

    /// Scans the meshes or scenes of `row`, and how many there are.
    fn scanning(&self, row: usize, seed: u64) -> anyhow::Result<(Workload<'_>, usize)>;
}

struct Network<'a> {
    path: PathBuf,
    recipe: &'a Recipe,
    classes: &'a [String],
}

struct Score {
    class: String,
    right: usize,
    of: usize,
    /// The chance that a negative's margin is above that of a known object, on the whole set.
    auroc: Option<f64>,
}

/// The answers of one network to one class of one set: a line of the CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Answer {
    trained_on: String,
    tested_on: String,
    seed: u64,
    class: String,
    right: usize,
    of: usize,
    auroc: Option<f64>,
}

fn measure<S: Study>(study: &S, out: &Path) -> anyhow::Result<()> {
    let mut answers: Vec<Answer> = Vec::new();
    for &seed in study.seeds() {
        for (row, name) in study.rows().into_iter().enumerate() {
            let file = out.join(format!("answers/{}-{seed}.json", folder_name(name)));
            answers.extend(resume::result(&file, || answers_of(study, row, seed, out))?);
        }
    }
    let costs = resume::result(&out.join("costs.json"), || costs(study))?;
    let mut csv = csv::Writer::from_writer(Vec::new());
    answers.iter().try_for_each(|answer| csv.serialize(answer))?;
    let file = out.join(format!("{}.csv", S::NAME));
    atomic::write_bytes(&file, csv.into_inner()?)?;
    let table = table(study, &answers, &costs);
    atomic::write_bytes(&out.join(format!("{}.md", S::NAME)), table.markdown())?;
    println!("{table}\n{}", file.display());
    Ok(())
}

/// The answers of the network of `row`, and those of the row beside it on the clouds of `row`.
fn answers_of<S: Study>(
    study: &S,
    row: usize,
    seed: u64,
    out: &Path,
) -> anyhow::Result<Vec<Answer>> {
    let (names, other) = (study.rows(), study.beside(row));
    let mut tests = vec![(row, BTreeSet::from([names[row], names[other], study.goal()]))];
    if other != row {
        tests.push((other, BTreeSet::from([names[row]])));
    }
    let mut answers = Vec::new();
    for (network, sets) in tests {
        let (recipe, clouds) = study.lesson(network, seed)?;
        let name = format!("{}-{seed}", folder_name(names[network]));
        let path = out.join(format!("networks/{name}.safetensors"));
        fs::create_dir_all(out.join("networks")).with_context(|| out.display().to_string())?;
        resume::network(&path, &name, recipe.clone(), &clouds)?;
        let trained = Network { path, recipe: &recipe, classes: &clouds.classes };
        for tested_on in sets {
            let scores = study.scores(&trained, tested_on, seed)?;
            answers.extend(scores.into_iter().map(|Score { class, right, of, auroc }| Answer {
                trained_on: names[network].to_owned(),
                tested_on: tested_on.to_owned(),
                seed,
                class,
                right,
                of,
                auroc,
            }));
        }
    }
    Ok(answers)
}

/// CPU seconds of a mesh or scene of each row, in rounds so that what disturbs the machine
/// disturbs all of them.
fn costs<S: Study>(study: &S) -> anyhow::Result<Vec<Spread>> {
    let seed = study.seeds()[0];
    let scannings = (0..study.rows().len()).map(|row| study.scanning(row, seed));
    let (mut workloads, counts): (Vec<_>, Vec<_>) =
        scannings.collect::<anyhow::Result<Vec<_>>>()?.into_iter().unzip();
    let rounds = interleave(study.cost_rounds(), &mut workloads)?;
    let each = rounds.iter().zip(counts);
    Ok(each.map(|(r, n)| Spread::of(r.0.iter().map(|cost| cost.cpu_s / n as f64))).collect())
}

/// A line for each row: means over seeds.
fn table<S: Study>(study: &S, answers: &[Answer], costs: &[Spread]) -> Table {
    let (names, goal) = (study.rows(), study.goal());
    let mut classes: Vec<&str> = Vec::new();
    for answer in answers {
        if !classes.contains(&answer.class.as_str()) {
            classes.push(&answer.class);
        }
    }
    let mut heading = vec!["row", "on the row beside", "the other's", "on its own"];
    heading.extend(&classes);
    heading.extend(["mean", "gain", "least", "most", "AUROC", "scan, ms", "least", "most", "x"]);
    let title = format!(
        "Right answers, %, mean over classes and seeds: of each row's network on the clouds of the \
         row beside it (the first, if no other is named), of the other's network on its clouds, and \
         of its own; then on {goal} by class, and the gain over the first row; CPU time of a scan"
    );
    let mut table = Table::new(title, &heading);
    for (row, (&name, cost)) in names.iter().zip(costs).enumerate() {
        let other = names[study.beside(row)];
        let over_seeds = |trained: &str, tested: &str| -> Vec<f64> {
            let of = |&seed: &u64| mean_over_classes(answers, trained, tested, seed);
            study.seeds().iter().filter_map(of).collect()
        };
        let shown = |shares: &[f64]| mean(shares).map_or("-".to_owned(), percent);
        let mut cells = vec![
            name.to_owned(),
            shown(&over_seeds(name, other)),
            shown(&over_seeds(other, name)),
            shown(&over_seeds(name, name)),
        ];
        let on_goal: Vec<&Answer> =
            answers.iter().filter(|a| a.trained_on == name && a.tested_on == goal).collect();
        for class in &classes {
            let of_class = on_goal.iter().filter(|answer| answer.class == *class);
            cells.push(shown(&of_class.filter_map(|answer| answer.share()).collect::<Vec<_>>()));
        }
        let (own, first) = (over_seeds(name, goal), over_seeds(names[0], goal));
        cells.push(shown(&own));
        let gains: Vec<f64> = own.iter().zip(&first).map(|(a, b)| 100.0 * (a - b)).collect();
        let ends = Spread::of(gains.iter().copied());
        let figures = mean(&gains).map_or([None; 3], |mean| [mean, ends.min, ends.max].map(Some));
        cells.extend(figures.map(|x| x.map_or("-".to_owned(), |x| format!("{x:+.1}"))));
        let aurocs: Vec<f64> = on_goal.iter().filter_map(|answer| answer.auroc).collect();
        cells.push(mean(&aurocs).map_or("-".to_owned(), |auroc| format!("{auroc:.3}")));
        cells.extend([cost.median, cost.min, cost.max].map(|seconds| digits(1e3 * seconds)));
        cells.push(format!("{:.2}", cost.median / costs[0].median));
        table.push(cells);
    }
    table
}

/// The mean over classes of the share of right answers; `None` if nothing was tested.
fn mean_over_classes(answers: &[Answer], trained: &str, tested: &str, seed: u64) -> Option<f64> {
    let of = |a: &&Answer| a.trained_on == trained && a.tested_on == tested && a.seed == seed;
    mean(&answers.iter().filter(of).filter_map(Answer::share).collect::<Vec<_>>())
}

impl Answer {
    fn share(&self) -> Option<f64> {
        (self.of > 0).then(|| self.right as f64 / self.of as f64)
    }
}

fn mean(shares: &[f64]) -> Option<f64> {
    (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
}

fn folder_name(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-").to_lowercase()
}

/// Checks what all plans of ablations have.
fn check_rows<'a>(
    seeds: &[u64],
    cost_rounds: usize,
    names: impl Iterator<Item = &'a str>,
    goal: Option<&str>,
) -> anyhow::Result<()> {
    let distinct: BTreeSet<&u64> = seeds.iter().collect();
    let is_valid = !seeds.is_empty() && distinct.len() == seeds.len();
    ensure!(is_valid, "seeds: expected one or more, all distinct");
    ensure!(cost_rounds > 0, "cost_rounds: expected 1 or more, found 0");
    let mut folders = BTreeSet::new();
    for name in names {
        let folder = folder_name(name);
        ensure!(!folder.is_empty(), "row: expected a name of letters, found \"{name}\"");
        let is_free = goal != Some(name) && folders.insert(folder);
        ensure!(is_free, "row \"{name}\": expected another name");
    }
    ensure!(!folders.is_empty(), "row: expected at least one, found none");
    Ok(())
}
