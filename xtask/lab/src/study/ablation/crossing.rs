//! Networks by the set that they were trained on, each tested on several sets.

use super::design::{Design, Test};
use super::rows::Answer;
use super::train_test_split::{self, TrainTestSplit};
use crate::study::resume;
use anyhow::Context;
use formats::atomic;
use infer_cpu::Options;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use train::evaluate::confusion;

/// Trains the networks of `design` that `out` does not hold yet, tests them, and
/// writes the answers to `answers.csv`. The sets' paths are relative to `folder`.
///
/// # Errors
/// A design or data that cannot be used, or that differ from an earlier run's.
pub fn run(design: &Design, folder: &Path, out: &Path) -> anyhow::Result<Vec<Answer>> {
    let sets = train_test_split::read(design, folder)?;
    resume::keep_terms(&terms(design, &sets)?, out)?;
    let networks = out.join("networks");
    fs::create_dir_all(&networks).with_context(|| format!("cannot make {}", networks.display()))?;
    let learnt: BTreeSet<&str> = design.tests.iter().map(|test| &*test.trained_on).collect();
    let mut answers = Vec::new();
    for &seed in &design.seeds {
        for &trained_on in &learnt {
            answers.extend(answers_of(design, &sets, (trained_on, seed), &networks)?);
        }
    }
    let mut csv = csv::Writer::from_writer(Vec::new());
    answers.iter().try_for_each(|answer| csv.serialize(answer))?;
    atomic::write_bytes(&out.join("answers.csv"), csv.into_inner()?)?;
    Ok(answers)
}

/// The answers of the network of one set and seed.
fn answers_of(
    design: &Design,
    sets: &BTreeMap<String, TrainTestSplit>,
    (trained_on, seed): (&str, u64),
    networks: &Path,
) -> anyhow::Result<Vec<Answer>> {
    let clouds = &sets[trained_on].train;
    let recipe = design.recipe(clouds.len(), seed);
    let epochs = recipe.epochs;
    let name = format!("{trained_on}-seed-{seed}");
    let model = networks.join(format!("{name}.safetensors"));
    resume::network(&model, &name, recipe, clouds)?;
    let tests: BTreeSet<&Test> =
        design.tests.iter().filter(|test| test.trained_on == trained_on).collect();
    let answer = |test: &Test| {
        let found = confusion(&model, &sets[&test.tested_on].test, &Options::default())?;
        Ok(Answer {
            trained_on: trained_on.to_owned(),
            tested_on: test.tested_on.clone(),
            seed,
            correct: found.correct(),
            n: found.total(),
            train_clouds: clouds.len(),
            epochs,
        })
    };
    tests.into_iter().map(answer).collect()
}

/// All that the answers depend on.
fn terms(design: &Design, sets: &BTreeMap<String, TrainTestSplit>) -> anyhow::Result<String> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        sha256: BTreeMap<&'a str, String>,
        design: &'a Design,
    }
    let sha256 = sets.iter().map(|(name, set)| (name.as_str(), set.sha256())).collect();
    Ok(toml::to_string(&Terms { version: env!("CARGO_PKG_VERSION"), sha256, design })?)
}
