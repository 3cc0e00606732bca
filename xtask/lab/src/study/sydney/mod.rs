//! `cargo xtask bench sydney`: the protocol of the Sydney Urban Objects benchmark
//! (De Deuge et al. 2013).
//!
//! Each fold is tested once, by a network that has learnt from all others; the figure is
//! the mean over folds of the weighted F1. Networks that start from a model are compared
//! with such that start from random numbers, by the same recipe. Each answer is the mean
//! of several, to random draws of the object's points that are turned about the up axis.

mod folds;
mod score;
#[cfg(test)]
mod tests;

use super::resume;
use crate::render::table::{Table, percent};
use anyhow::Result;
use clap::Args;
use folds::Folds;
use formats::{atomic, hash};
use infer_cpu::Options;
use score::{Answer, f1, interval, mean, weighted_f1};
use serde::Serialize;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use train::clouds::Clouds;
use train::evaluate::predictions;
use train::recipe::Recipe;
use xtask::workspace::root;

/// Flags of `bench sydney`.
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

/// The networks that begin in one way.
struct Start {
    name: &'static str,
    /// `[seed][fold]`, by votes.
    answers: Vec<Vec<Vec<Answer>>>,
    /// The same without votes.
    single: Vec<Vec<Vec<Answer>>>,
}

/// Trains and tests the networks, prints the tables and writes the report.
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
    let mut report = String::new();
    for table in [by_fold(&starts, &folds), summary(&starts), by_class(&starts, &folds)] {
        print!("{table}");
        writeln!(report, "{}", table.markdown())?;
    }
    if let Some(file) = &args.report {
        atomic::write_bytes(file, report)?;
    }
    Ok(())
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

/// What `model` makes of `clouds`, by the mean log-probabilities of `votes` draws.
fn answers_of(model: &Path, clouds: &Clouds, votes: u32) -> Result<Vec<Answer>> {
    let options = Options { votes, vote_rotations: votes > 1, ..Options::default() };
    let found = predictions(model, clouds, &options)?;
    Ok(clouds.set.labels.iter().zip(found).map(|(&label, found)| (label, found.class)).collect())
}

/// The weighted F1 of each network.
fn by_fold(starts: &[Start], folds: &Folds) -> Table {
    let numbers = folds.numbers().into_iter().map(|fold| format!("fold {fold}"));
    let heading = ["start".to_owned(), "seed".to_owned()].into_iter().chain(numbers);
    let heading: Vec<String> = heading.chain(["mean".to_owned()]).collect();
    let heading: Vec<&str> = heading.iter().map(String::as_str).collect();
    let mut table = Table::new("Weighted F1 of each network, %", &heading);
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

/// The means over folds and seeds, and how sure they are.
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

/// F1 of each class, of all folds and seeds together.
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
