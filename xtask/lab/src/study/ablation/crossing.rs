//! Networks by the set that they were trained on, each tested on several sets.

use super::design::{Design, Set};
use super::rows::Answer;
use super::rows::Test;
use super::sets::{self, Sets};
use super::write_csv;
use crate::study::resume;
use anyhow::Context;
use formats::split::Split;
use infer_cpu::Options;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use train::evaluate::confusion;

/// Trains the networks of `design` that `out` does not hold yet, tests them, and
/// writes the answers to `answers.csv`. The sets' paths are relative to `folder`.
pub fn run(design: &Design, folder: &Path, out: &Path) -> anyhow::Result<Vec<Answer>> {
    let sets = sets::read(design, folder)?;
    resume::keep_terms(&terms(design, &sets)?, &out.join("terms.toml"))?;
    let networks = out.join("networks");
    fs::create_dir_all(&networks).with_context(|| format!("cannot make {}", networks.display()))?;
    let learnt: BTreeSet<&str> = design.tests.iter().map(|test| test.trained_on).collect();
    let mut answers = Vec::new();
    for &seed in &design.seeds {
        for &trained_on in &learnt {
            answers.extend(answers_of(design, &sets, (trained_on, seed), &networks)?);
        }
    }
    write_csv(&answers, &out.join("answers.csv"))?;
    Ok(answers)
}

/// The answers of the network of one set and seed.
fn answers_of(
    design: &Design,
    sets: &Sets,
    (trained_on, seed): (&'static str, u64),
    networks: &Path,
) -> anyhow::Result<Vec<Answer>> {
    let clouds = &sets[&(trained_on, Split::Train)];
    let recipe = design.recipe(clouds.len(), seed);
    let epochs = recipe.epochs;
    let name = format!("{trained_on}-seed-{seed}");
    let model = networks.join(format!("{name}.safetensors"));
    resume::network(&model, &name, recipe, clouds)?;
    let tests: BTreeSet<&Test> =
        design.tests.iter().filter(|test| test.trained_on == trained_on).collect();
    let answer = |&Test { tested_on, .. }: &Test| {
        let found = confusion(&model, &sets[&(tested_on, Split::Test)], &Options::default())?;
        let (correct, n, train_clouds) = (found.correct(), found.total(), clouds.len());
        Ok(Answer { trained_on, tested_on, seed, correct, n, train_clouds, epochs })
    };
    tests.into_iter().map(answer).collect()
}

/// All that the answers depend on.
fn terms(design: &Design, sets: &Sets) -> anyhow::Result<String> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        sha256: BTreeMap<&'a str, String>,
        design: &'a Design,
    }
    let digest = |set: &Set| (set.name, sets::sha256(sets, set.name));
    let sha256 = design.sets.iter().map(digest).collect();
    Ok(toml::to_string(&Terms { version: env!("CARGO_PKG_VERSION"), sha256, design })?)
}
