//! `cargo xtask bench sydney`: the protocol of the Sydney Urban Objects benchmark
//! (De Deuge et al. 2013).
//!
//! Each fold is tested once, by a network that has learnt from all others; the figure is
//! the mean over folds of the weighted F1. Networks that start from a model are compared
//! with such that start from random numbers, by the same recipe. Each answer is the mean
//! of several, to random draws of the object's points that are turned about the up axis.

use super::resume;
use crate::table::{Table, percent, publish};
use anyhow::{Context, Result, ensure};
use clap::Args;
use formats::hash;
use formats::labelled::LabelledSet;
use formats::model_card::Normalization;
use formats::rng::StreamKey;
use formats::split::Split;
use infer_cpu::Options;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::evaluate::predictions;
use train::recipe::Recipe;
use train::run::MOST_POINTS;
use xtask::workspace::root;

#[derive(Args, Debug)]
pub struct SydneyArgs {
    /// NPZ files of clusters in metres with `raw_labels` and `fold`, the fold of each; all
    /// files together hold the folds.
    #[arg(required = true, value_name = "FOLDS")]
    folds: Vec<PathBuf>,
    /// Model whose weights training starts from [default: street-128 of assets/weights].
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,
    /// Recipe [default: sydney.toml of assets/recipes].
    #[arg(long, value_name = "TOML")]
    recipe: Option<PathBuf>,
    /// Number of networks for each fold.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Number of draws of an object's points, each turned further, that an answer is the mean of.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..))]
    votes: u32,
    /// Folder for the networks; an interrupted run is resumed.
    #[arg(long, value_name = "DIR", default_value = "data/sydney")]
    out: PathBuf,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

struct Start {
    name: &'static str,
    /// `[seed][fold]`, by votes.
    answers: Vec<Vec<Vec<Answer>>>,
    single: Vec<Vec<Vec<Answer>>>,
}

pub fn run(args: &SydneyArgs) -> Result<()> {
    let folds = Folds::read(&args.folds)?;
    let path = args.recipe.clone();
    let recipe = Recipe::read(&path.unwrap_or_else(|| root().join("assets/recipes/sydney.toml")))?;
    let init = args.init.clone();
    let init = init.unwrap_or_else(|| root().join("assets/weights/street-128.safetensors"));
    keep_terms(args, &init, &recipe)?;
    let [trained, scratch] = [Some(init), None].map(|init| Recipe { init, ..recipe.clone() });
    let starts = [
        start("pre-trained", &trained, &folds, args)?,
        start("from scratch", &scratch, &folds, args)?,
    ];
    let tables = [by_fold(&starts, &folds), summary(&starts), by_class(&starts, &folds)];
    publish(&tables, args.report.as_deref())
}

/// Writes all that the networks depend on beside them, or compares it with an earlier
/// run's.
fn keep_terms(args: &SydneyArgs, init: &Path, recipe: &Recipe) -> Result<()> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        folds: Vec<String>,
        init: String,
        recipe: &'a Recipe,
    }
    let digests = args.folds.iter().map(|path| hash::of_file(path));
    let folds = digests.collect::<Result<_, _>>()?;
    let (version, init) = (env!("CARGO_PKG_VERSION"), hash::of_file(init)?);
    let terms = toml::to_string(&Terms { version, folds, init, recipe })?;
    fs::create_dir_all(&args.out)?;
    resume::keep_terms(&terms, &args.out.join("terms.toml"))
}

/// Trains the networks of `recipe` and tests each on its fold.
fn start(name: &'static str, recipe: &Recipe, folds: &Folds, args: &SydneyArgs) -> Result<Start> {
    let mut start = Start { name, answers: Vec::new(), single: Vec::new() };
    for seed in 0..args.seeds {
        let (mut answers, mut single) = (Vec::new(), Vec::new());
        for fold in folds.numbers() {
            let [learnt, tested] = folds.split(fold);
            let file = format!("{}-{seed}-fold-{fold}", name.replace(' ', "-"));
            let model = args.out.join(format!("{file}.safetensors"));
            resume::network(&model, &file, Recipe { seed, ..recipe.clone() }, &learnt)?;
            answers.push(answers_of(&model, &tested, args.votes)?);
            single.push(answers_of(&model, &tested, 1)?);
        }
        start.answers.push(answers);
        start.single.push(single);
    }
    Ok(start)
}

/// The answers of `model` to `clouds`, by the mean log-probabilities of `votes` draws.
fn answers_of(model: &Path, clouds: &Clouds, votes: u32) -> Result<Vec<Answer>> {
    let options = Options { votes, vote_rotations: votes > 1, ..Options::default() };
    let found = predictions(model, clouds, &options)?;
    Ok(clouds.set.labels.iter().zip(found).map(|(&label, found)| (label, found.class)).collect())
}

fn by_fold(starts: &[Start], folds: &Folds) -> Table {
    let mut table = Table::new("Weighted F1 of each network, %", &["start", "seed"]);
    table.heading.extend(folds.numbers().into_iter().map(|fold| format!("fold {fold}")));
    table.heading.push("mean".to_owned());
    for Start { name, answers, .. } in starts {
        for (seed, answers) in answers.iter().enumerate() {
            let found: Vec<f64> = answers.iter().map(|answers| weighted_f1(answers)).collect();
            let mean = found.iter().sum::<f64>() / found.len() as f64;
            let cells = found.into_iter().chain([mean]).map(percent);
            table.push([(*name).to_owned(), seed.to_string()].into_iter().chain(cells).collect());
        }
    }
    table
}

/// The means over folds and seeds, with intervals.
fn summary(starts: &[Start; 2]) -> Table {
    let heading = ["start", "mean", "95 % interval", "seeds from", "to", "mean without votes"];
    let mut table = Table::new("Weighted F1, mean over folds and seeds, %", &heading);
    let words = |[low, high]: [f64; 2]| format!("{} to {}", percent(low), percent(high));
    for Start { name, answers, single } in starts {
        let seeds = answers.iter().map(|folds| mean(std::slice::from_ref(folds)));
        let mut seeds: Vec<f64> = seeds.collect();
        seeds.sort_by(f64::total_cmp);
        table.push(vec![
            (*name).to_owned(),
            percent(mean(answers)),
            words(interval([answers], |[mean]| mean)),
            percent(seeds[0]),
            percent(seeds[seeds.len() - 1]),
            percent(mean(single)),
        ]);
    }
    let [a, b] = [&starts[0], &starts[1]];
    table.push(vec![
        "difference".to_owned(),
        percent(mean(&a.answers) - mean(&b.answers)),
        words(interval([&a.answers, &b.answers], |[a, b]| a - b)),
        String::new(),
        String::new(),
        percent(mean(&a.single) - mean(&b.single)),
    ]);
    table
}

fn by_class(starts: &[Start; 2], folds: &Folds) -> Table {
    let heading = ["class", "objects", starts[0].name, starts[1].name];
    let mut table = Table::new("F1 of each class, all folds and seeds together, %", &heading);
    let together = [0, 1].map(|i| starts[i].answers.concat().concat());
    for (class, name) in folds.clouds.classes.iter().enumerate() {
        let n = folds.clouds.set.labels.iter().filter(|&&label| label == class).count();
        let [a, b] = [0, 1].map(|i| percent(f1(&together[i], class).0));
        table.push(vec![name.clone(), n.to_string(), a, b]);
    }
    table
}

/// Objects, and the fold that each is in.
pub struct Folds {
    pub clouds: Clouds,
    pub fold: Vec<u32>,
}

impl Folds {
    /// Reads all `files`. The classes are the sorted labels of the data's source.
    pub fn read(files: &[PathBuf]) -> Result<Self> {
        let mut sets = Vec::new();
        for path in files {
            let clouds = Clouds::read_for(Normalization::Metric, path, Split::Train, MOST_POINTS)?;
            let set = clouds.set;
            let lacks =
                |key| format!("{}: {key}: expected one for each cloud, found none", path.display());
            let fold = set.fold.clone().with_context(|| lacks("fold"))?;
            let labels = set.raw_labels.clone().with_context(|| lacks("raw_labels"))?;
            sets.push((set, labels, fold));
        }
        let classes: BTreeSet<&String> = sets.iter().flat_map(|(_, labels, _)| labels).collect();
        let classes: Vec<String> = classes.into_iter().cloned().collect();
        let (mut all, mut fold) = (LabelledSet::default(), Vec::new());
        for (set, labels, folds) in &sets {
            for (i, label) in labels.iter().enumerate() {
                let class = classes.binary_search(label).expect("invariant: all are listed");
                all.push(set.cloud(i), class);
            }
            fold.extend(folds);
        }
        let folds = Self { clouds: Clouds { set: all, classes }, fold };
        let n = folds.numbers().len();
        ensure!(n > 1, "fold: expected two folds or more in all files together, found {n}");
        Ok(folds)
    }

    pub fn numbers(&self) -> Vec<u32> {
        self.fold.iter().copied().collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The clouds to train on when `fold` is tested, and those of `fold`.
    pub fn split(&self, fold: u32) -> [Clouds; 2] {
        [false, true].map(|is_tested| {
            let is_in = |&i: &usize| (self.fold[i] == fold) == is_tested;
            self.clouds.select(&(0..self.fold.len()).filter(is_in).collect::<Vec<_>>())
        })
    }
}

pub type Answer = (usize, usize);

/// F1 of `class`, and how many objects it has.
pub fn f1(answers: &[Answer], class: usize) -> (f64, usize) {
    let count = |is: &dyn Fn(&Answer) -> bool| answers.iter().filter(|answer| is(answer)).count();
    let right = count(&|answer| *answer == (class, class));
    let (support, given) = (count(&|answer| answer.0 == class), count(&|answer| answer.1 == class));
    (2.0 * right as f64 / (support + given).max(1) as f64, support)
}

/// The mean of F1 over classes, each weighted by its objects.
pub fn weighted_f1(answers: &[Answer]) -> f64 {
    let most = answers.iter().map(|answer| answer.0).max().unwrap_or(0);
    let weighted = (0..=most).map(|class| f1(answers, class));
    weighted.map(|(f1, n)| f1 * n as f64).sum::<f64>() / answers.len().max(1) as f64
}

/// The mean over folds of the mean over seeds of the weighted F1: `[seed][fold]`.
pub fn mean(answers: &[Vec<Vec<Answer>>]) -> f64 {
    let all: Vec<f64> = answers.iter().flatten().map(|answers| weighted_f1(answers)).collect();
    all.iter().sum::<f64>() / all.len().max(1) as f64
}

/// Bootstrap draws for an interval.
const DRAWS: u32 = 1000;

/// The 95 % interval of `statistic` over bootstrap draws of the objects of each fold, the same for
/// all networks (Efron, percentiles).
pub fn interval<const N: usize>(
    networks: [&[Vec<Vec<Answer>>]; N],
    statistic: impl Fn([f64; N]) -> f64,
) -> [f64; 2] {
    let draw = |number| {
        statistic(networks.map(|answers| {
            let seeds = answers.iter().map(|folds| {
                let drawn = folds.iter().enumerate().map(|(fold, answers)| {
                    let key = StreamKey::new(0, &format!("fold {fold}"), number);
                    let n = answers.len() as u64;
                    (0..n).map(|i| answers[key.below(n, i) as usize]).collect()
                });
                drawn.collect()
            });
            mean(&seeds.collect::<Vec<Vec<Vec<Answer>>>>())
        }))
    };
    let mut found: Vec<f64> = (0..DRAWS).map(draw).collect();
    found.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| found[(share * f64::from(DRAWS)) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use test_support::{need, shared_data};

    #[test]
    fn a_fold_is_tested_by_networks_of_the_others() {
        let mut set = LabelledSet::default();
        (0..6).for_each(|i| set.push(&[[i as f32; 3]], 0));
        let clouds = Clouds { set, classes: vec!["car".to_owned()] };
        let folds = Folds { clouds, fold: vec![0, 1, 2, 0, 1, 2] };
        let [learnt, tested] = folds.split(2);
        assert_eq!(
            (learnt.len(), tested.set.points.as_slice()),
            (4, &[2.0f32, 2.0, 2.0, 5.0, 5.0, 5.0][..])
        );
        assert_eq!(folds.numbers(), [0, 1, 2]);
    }

    #[test]
    fn the_benchmark_s_own_folds_are_read() {
        let file = need!(shared_data("real_objects/sydney_folds01.npz"));
        let folds = Folds::read(&[file]).unwrap();
        assert_eq!((folds.clouds.len(), folds.clouds.classes.len()), (297, 14));
        assert_eq!(folds.numbers(), [0, 1]);
    }

    /// Class 0: precision 2/3, recall 2/2, F1 4/5; class 1: 1/1, 1/2, 2/3.
    #[test]
    fn f1_is_weighted_by_the_objects_of_a_class() {
        let answers = [(0, 0), (0, 0), (1, 0), (1, 1)];
        let (found, n) = f1(&answers, 1);
        assert_eq!(n, 2);
        assert!((found - 2.0 / 3.0).abs() < 1e-12);
        let expected = (2.0 * 0.8 + 2.0 * 2.0 / 3.0) / 4.0;
        assert!((weighted_f1(&answers) - expected).abs() < 1e-12);
        assert_eq!(f1(&answers, 2), (0.0, 0));
        let [low, high] = interval([&[vec![answers.to_vec()]]], |[mean]| mean);
        assert!(low < expected && high > expected && high <= 1.0, "{low} {high}");
    }
}
