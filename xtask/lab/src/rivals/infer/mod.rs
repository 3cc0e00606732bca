//! `cargo xtask bench infer`: compares our classifier and sampler with those of other
//! projects, on the same weights and clouds, in one run, in turns.

mod candidate;
mod classify;
mod comparison;
pub mod learn;
mod model;
mod ours;
mod roster;
mod speed_tables;

use crate::measure::machine::Machine;
use anyhow::Result;
use candidate::Candidate;
use clap::Args;
use comparison::Entry;
use edgepuck_program::Usage;
use formats::atomic;
use roster::{CLASSIFIERS, Material, SAMPLERS};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use xtask::venv::cache_dir;
use xtask::workspace::recorded;

#[derive(Args, Debug)]
pub struct InferArgs {
    /// Weights for all engines: a safetensors file with the key names of yanx27's `pointnet_cls`
    /// [default: random weights of the same shapes].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Sizes of the clouds to classify, in points.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = positive,
          default_value = "16,32,64,128,256,512,1024,2048,4096")]
    points: Vec<usize>,
    /// Numbers of threads to classify with.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = positive,
          default_value = "1,2")]
    threads: Vec<usize>,
    /// Number of rounds. In each round, every engine repeats every job several times; the median of
    /// all repeats is shown.
    #[arg(long, value_name = "N", default_value = "9", value_parser = positive)]
    rounds: usize,
    /// Write all figures, with every repeat, to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Measure only these engines; `ours` is infer-cpu in all its precisions, and `ncnn` includes
    /// `ncnn-f16` [default: all except PyTorch].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    engines: Vec<String>,
    /// Also measure PyTorch, which is a download of about 5 GB from PyPI.
    #[arg(long)]
    torch: bool,
}

#[derive(Serialize)]
struct Report {
    machine: Machine,
    model: String,
    versions: BTreeMap<String, String>,
    classifying: Vec<Entry>,
    sampling: Vec<Entry>,
}

pub fn run(args: &InferArgs) -> Result<()> {
    check(&args.engines)?;
    let is_wanted = |name: &str| {
        let by = |wanted: &String| is_named(name, wanted);
        args.engines.is_empty() || args.engines.iter().any(by)
    };
    let folder = cache_dir().join("infer");
    let random = folder.join("random.safetensors");
    if args.model.is_none() {
        model::write_random(&random)?;
    }
    let material = Material { model: args.model.clone().unwrap_or(random), folder };
    let mut reference = ours::reference(&material.model)?;
    let cloud = model::cloud(args.points.iter().copied().fold(classify::MOST_POINTS, usize::max));
    model::write_cloud(&cloud, &material.cloud())?;

    let mut classifiers = ours::classifiers(&material.model, &cloud, is_wanted);
    classifiers.extend(roster::start(&CLASSIFIERS, is_wanted, args.torch, &material));
    let mut samplers: Vec<_> = ours::sampler(&cloud, is_wanted).into_iter().collect();
    samplers.extend(roster::start(&SAMPLERS, is_wanted, args.torch, &material));
    let version = |candidate: &Candidate| (candidate.label.name.clone(), candidate.version.clone());
    let mut report = Report {
        machine: Machine::here(),
        versions: classifiers.iter().chain(&samplers).map(version).collect(),
        model: recorded(&material.model),
        classifying: Vec::new(),
        sampling: Vec::new(),
    };
    if !classifiers.is_empty() {
        let (points, threads) = (&args.points, &args.threads);
        let reference = (&mut reference, &cloud[..]);
        report.classifying =
            classify::classify_all(&mut classifiers, points, threads, args.rounds, reference)?;
    }
    if !samplers.is_empty() {
        report.sampling = classify::sample_all(&mut samplers, args.rounds, &cloud);
    }
    if let Some(file) = &args.json {
        atomic::write_bytes(file, serde_json::to_string(&report)? + "\n")?;
    }
    Ok(())
}

fn is_named(engine: &str, word: &str) -> bool {
    engine.strip_prefix(word).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

fn check(words: &[String]) -> Result<(), Usage> {
    let rivals = CLASSIFIERS.iter().chain(&SAMPLERS).map(|rival| rival.0.to_owned());
    let known: Vec<String> = ours::names().into_iter().chain(rivals).collect();
    let is_unknown = |word: &&String| !known.iter().any(|engine| is_named(engine, word));
    match words.iter().find(is_unknown) {
        Some(word) => {
            Err(Usage(format!("expected an engine among {}, found {word}", known.join(", "))))
        }
        None => Ok(()),
    }
}

fn positive(word: &str) -> Result<usize, String> {
    word.parse().ok().filter(|&n| n > 0).ok_or_else(|| "expected a positive number".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_names_an_engine_and_its_variants() {
        assert!(is_named("ncnn-f16", "ncnn"));
        assert!(is_named("ncnn-f16", "ncnn-f16"));
        assert!(!is_named("ncnn", "ncnn-f16"));
        assert!(!is_named("torchscript", "torch"));
        assert!(check(&["ours".to_owned(), "fpsample".to_owned()]).is_ok());
        let error = check(&["onnx".to_owned()]).unwrap_err();
        assert!(error.to_string().starts_with("expected an engine among ours-f32,"));
    }
}
