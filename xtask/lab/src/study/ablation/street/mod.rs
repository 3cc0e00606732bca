//! `cargo xtask ablate --street`: which effect of street scenes makes a network better, on
//! simulated and on real objects, and what it costs.
//!
//! For each row of the plan and each seed, scenes are drawn, scanned and cut, and a network
//! learns from their clusters. It is tested on scenes without the effect, on scenes with it,
//! and on real objects; the network of the first row is tested on all of them, too.

pub mod plan;

use crate::measure::clock::{Spread, Workload, interleave, measured};
use crate::render::table::{Table, percent};
use crate::study::resume;
use anyhow::Context;
use edgepuck_program::Outcome;
use edgepuck_scenes::{Scene, SceneError, Stage, generate};
use edgepuck_segment::Settings;
use formats::{atomic, hash};
use infer_cpu::Options;
use plan::{NETWORK, Plan, Row, STREET};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::object_report::{Labels, Object, Truth, classified, detection};
use train::recipe::Recipe;
use train::run::MOST_POINTS;

/// What objects that should be called nothing are.
const NEGATIVES: &str = "negatives";

/// What the real objects are called as a set to test on.
const REAL: &str = "real objects";

/// The answers of one network to one set: a line of `street.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Answer {
    trained_on: String,
    tested_on: String,
    seed: u64,
    /// A class that is known, or [`NEGATIVES`].
    class: String,
    right: usize,
    of: usize,
    /// The chance that a negative's margin is above that of a known object, on the whole set.
    auroc: Option<f64>,
}

/// Makes, trains, tests and compares what `out` lacks; writes `street.csv`,
/// `street-costs.csv` and `street.md`, and prints the latter.
pub fn run(plan: &Plan, real: &[PathBuf], out: &Path) -> anyhow::Result<Outcome> {
    fs::create_dir_all(out.join("networks"))
        .with_context(|| format!("cannot make {}", out.display()))?;
    keep_terms(plan, real, out)?;
    let study = Study { plan, real, out };
    let mut answers = Vec::new();
    for &seed in &plan.seeds {
        for row in &plan.row {
            let file = out.join(format!("answers/{}-{seed}.json", row.folder()));
            answers.extend(resume::result(&file, || study.answers_of(row, seed))?);
        }
    }
    let costs = resume::result(&out.join("costs.json"), || costs(plan))?;
    super::write_csv(&answers, &out.join("street.csv"))?;
    let table = table(plan, &answers, &costs);
    atomic::write_bytes(&out.join("street.md"), table.markdown())?;
    println!("{table}\n{}", out.join("street.csv").display());
    Ok(Outcome::Success)
}

/// Writes the plan and hashes of the real objects, or compares them with an earlier run's.
fn keep_terms(plan: &Plan, real: &[PathBuf], out: &Path) -> anyhow::Result<()> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        real: Vec<String>,
        street: String,
        network: String,
        plan: &'a Plan,
    }
    let real = real.iter().map(|path| hash::of_file(path)).collect::<Result<_, _>>()?;
    let [street, network] = [STREET, NETWORK].map(|text| hash::of_bytes(text.as_bytes()));
    let version = env!("CARGO_PKG_VERSION");
    let text = toml::to_string(&Terms { version, real, street, network, plan })?;
    resume::keep_terms(&text, &out.join("terms.toml"))
}

/// What all rows share.
struct Study<'a> {
    plan: &'a Plan,
    real: &'a [PathBuf],
    out: &'a Path,
}

/// A trained network.
struct Network {
    path: PathBuf,
    recipe: Recipe,
    labels: Labels,
}

impl Study<'_> {
    /// What the network of `row` makes of all sets, and that of the first row of `row`'s scenes.
    fn answers_of(&self, row: &Row, seed: u64) -> anyhow::Result<Vec<Answer>> {
        let base = &self.plan.row[0];
        let network = self.network(row, seed)?;
        let mut answers =
            self.answers(&network, (row, base), seed, &[self.test_set(base, seed)?])?;
        if row.name != base.name {
            let own = [self.test_set(row, seed)?];
            answers.extend(self.answers(&network, (row, row), seed, &own)?);
            let plain = self.network(base, seed)?;
            answers.extend(self.answers(&plain, (base, row), seed, &own)?);
        }
        let on_real = |answer| Answer { tested_on: REAL.to_owned(), ..answer };
        let real = self.answers(&network, (row, base), seed, self.real)?;
        answers.extend(real.into_iter().map(on_real));
        Ok(answers)
    }

    /// The network of `row`, trained if it is not there.
    fn network(&self, row: &Row, seed: u64) -> anyhow::Result<Network> {
        let name = format!("{}-{seed}", row.folder());
        let path = self.out.join("networks").join(format!("{name}.safetensors"));
        let recipe = self.plan.recipe_of(row, seed)?;
        let scenes = self.scenes(row, seed)?.join("train.npz");
        let clouds = Clouds::read_for(
            recipe.normalization,
            &scenes,
            formats::split::Split::Train,
            MOST_POINTS,
        )?;
        resume::network(&path, &name, recipe.clone(), &clouds)?;
        let is_known = |class: &&String| self.plan.known.contains(class);
        let unknown: Vec<String> =
            clouds.classes.iter().filter(|class| !is_known(class)).cloned().collect();
        let labels = Labels::new(&clouds.classes, &unknown);
        Ok(Network { path, recipe, labels })
    }

    fn test_set(&self, row: &Row, seed: u64) -> anyhow::Result<PathBuf> {
        Ok(self.scenes(row, seed)?.join("test.npz"))
    }

    /// The folder of the clusters of `row`, made if they are not there. Rows of the same scenes
    /// share them.
    fn scenes(&self, row: &Row, seed: u64) -> anyhow::Result<PathBuf> {
        let recipe = row.scenes()?;
        let of = |other: &&Row| other.scenes().is_ok_and(|scenes| scenes == recipe);
        let first = self.plan.row.iter().find(of).unwrap_or(row);
        let folder = self.out.join(format!("scenes/{}-{seed}", first.folder()));
        if !folder.join("test.npz").is_file() {
            eprintln!("scenes of \"{}\", seed {seed}", first.name);
            let each = |_: &_| Ok::<_, SceneError>(());
            let stage = stage(first, seed)?;
            generate(&stage, &Settings::default(), self.plan.scenes, &folder, each)?;
        }
        Ok(folder)
    }

    /// What `network`, of the first of `rows`, makes of `files`, of the second: by class.
    fn answers(
        &self,
        network: &Network,
        (trained_on, tested_on): (&Row, &Row),
        seed: u64,
        files: &[PathBuf],
    ) -> anyhow::Result<Vec<Answer>> {
        let mut objects = Vec::new();
        for path in files {
            let (split, normalization) =
                (formats::split::Split::Test, network.recipe.normalization);
            let clouds = Clouds::read_for(normalization, path, split, MOST_POINTS)?;
            let wanted = (&network.labels, self.plan.min_points);
            let options = Options::default();
            objects.extend(classified(&network.path, "", &clouds, wanted, &options)?);
        }
        let margins = |is_known: bool| -> Vec<f64> {
            let some = objects.iter().filter(|o| (o.truth != Truth::Negative) == is_known);
            some.filter_map(|object| object.answer.margin).collect()
        };
        let auroc = detection(&margins(true), &margins(false)).map(|found| found.auroc);
        let classes = self.plan.known.iter().map(String::as_str).chain([NEGATIVES]);
        Ok(classes
            .map(|class| {
                let of: Vec<&Object> =
                    objects.iter().filter(|o| class_of(o, &network.labels) == class).collect();
                Answer {
                    trained_on: trained_on.name.clone(),
                    tested_on: tested_on.name.clone(),
                    seed,
                    class: class.to_owned(),
                    right: of.iter().filter(|object| object.is_right()).count(),
                    of: of.len(),
                    auroc,
                }
            })
            .collect())
    }
}

fn class_of<'a>(object: &Object, labels: &'a Labels) -> &'a str {
    match object.truth {
        Truth::Known(class) => &labels.classes()[class],
        Truth::Negative => NEGATIVES,
    }
}

fn stage(row: &Row, seed: u64) -> anyhow::Result<Stage> {
    Ok(Stage::new(row.scenes()?, "street.toml".as_ref(), None, seed)?)
}

/// CPU seconds of a scan of each row's scenes, in rounds so that what disturbs the machine
/// disturbs all of them.
fn costs(plan: &Plan) -> anyhow::Result<Vec<Spread>> {
    let mut workloads: Vec<Workload<'_>> = Vec::new();
    for row in &plan.row {
        let stage = stage(row, plan.seeds[0])?;
        let scenes: Vec<Scene> =
            (0..plan.cost_scenes).map(|number| Scene::draw(&stage, number)).collect();
        workloads.push(Box::new(move || {
            let (scanned, cost) =
                measured(|| scenes.iter().try_for_each(|scene| stage.sweep(scene).map(|_| ())));
            scanned?;
            Ok(cost)
        }));
    }
    let each = |seconds: f64| seconds / f64::from(plan.cost_scenes);
    let rounds = interleave(plan.cost_rounds, &mut workloads)?;
    Ok(rounds.iter().map(|r| Spread::of(r.0.iter().map(|cost| each(cost.cpu_s)))).collect())
}

/// A line for each row of `plan`: means over seeds.
fn table(plan: &Plan, answers: &[Answer], costs: &[Spread]) -> Table {
    let base = &plan.row[0].name;
    let mut heading = vec!["effect", "without", "with, untaught", "with"];
    heading.extend(plan.known.iter().map(String::as_str));
    heading.extend([NEGATIVES, "real mean", "gain", "least", "most", "AUROC", "scan, x"]);
    let title = "Right answers, %, mean over classes and seeds: simulated objects without the \
                 effect, with it (by the network that has not learnt it, and by its own), and real \
                 objects; gain on real ones over the first row; CPU time of a scan";
    let mut table = Table::new(title, &heading);
    for (row, cost) in plan.row.iter().zip(costs) {
        let name = &row.name;
        let over_seeds = |trained: &str, tested: &str| -> Vec<f64> {
            let of = |&seed: &u64| mean_over_classes(answers, trained, tested, seed);
            plan.seeds.iter().filter_map(of).collect()
        };
        let shown = |shares: &[f64]| mean(shares).map_or("-".to_owned(), percent);
        let mut cells = vec![
            name.clone(),
            shown(&over_seeds(name, base)),
            shown(&over_seeds(base, name)),
            shown(&over_seeds(name, name)),
        ];
        let on_real = |a: &&Answer| a.trained_on == *name && a.tested_on == REAL;
        for class in plan.known.iter().map(String::as_str).chain([NEGATIVES]) {
            let of_class = answers.iter().filter(on_real).filter(|a| a.class == class);
            cells.push(shown(&of_class.filter_map(share).collect::<Vec<_>>()));
        }
        let (real, of_base) = (over_seeds(name, REAL), over_seeds(base, REAL));
        cells.push(shown(&real));
        let gains: Vec<f64> = real.iter().zip(&of_base).map(|(a, b)| 100.0 * (a - b)).collect();
        let ends = Spread::of(gains.iter().copied());
        let points = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:+.1}"));
        let ends = (!gains.is_empty()).then_some(ends);
        cells.push(points(mean(&gains)));
        cells.extend([points(ends.map(|e| e.min)), points(ends.map(|e| e.max))]);
        let aurocs: Vec<f64> =
            answers.iter().filter(on_real).filter_map(|answer| answer.auroc).collect();
        cells.push(mean(&aurocs).map_or("-".to_owned(), |auroc| format!("{auroc:.3}")));
        cells.push(format!("{:.2}", cost.median / costs[0].median));
        table.push(cells);
    }
    table
}

/// The mean over classes of the share of right answers; `None` if nothing was tested.
fn mean_over_classes(answers: &[Answer], trained: &str, tested: &str, seed: u64) -> Option<f64> {
    let of = |a: &&Answer| a.trained_on == trained && a.tested_on == tested && a.seed == seed;
    mean(&answers.iter().filter(of).filter_map(share).collect::<Vec<_>>())
}

fn share(answer: &Answer) -> Option<f64> {
    (answer.of > 0).then(|| answer.right as f64 / answer.of as f64)
}

fn mean(shares: &[f64]) -> Option<f64> {
    (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
}
