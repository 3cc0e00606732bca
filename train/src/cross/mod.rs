//! `cross`: networks by what they were trained on, each tested on several sets.
//! What the sets stand for is known to the caller: `cargo xtask ablate`.

mod design;
mod halves;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use formats::atomic;
use infer_cpu::Options;
use serde::Serialize;
use train::evaluate::confusion;

use crate::once;
use design::{Design, Test};
use halves::Halves;

/// Flags of `cross`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Sets, tests and recipe
    #[arg(long, value_name = "TOML")]
    design: PathBuf,
    /// Where networks and answers.csv go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// A line of answers.csv.
#[derive(Serialize)]
struct Answer<'a> {
    trained_on: &'a str,
    tested_on: &'a str,
    seed: u64,
    correct: usize,
    n: usize,
    train_clouds: usize,
    epochs: u32,
}

/// Trains what is not trained yet, tests, and writes `answers.csv`.
///
/// # Errors
/// A design or data that cannot be used, or other ones than of an earlier run.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let design = Design::read(&args.design)?;
    let sets = halves::read(&design, args.design.parent().unwrap_or(Path::new("")))?;
    once::keep_terms(&terms(&design, &sets)?, &args.out)?;
    let networks = args.out.join("networks");
    fs::create_dir_all(&networks).with_context(|| format!("cannot make {}", networks.display()))?;
    let mut csv = csv::Writer::from_writer(Vec::new());
    for &seed in &design.seeds {
        let learnt: BTreeSet<&str> = design.tests.iter().map(|t| t.trained_on.as_str()).collect();
        for trained_on in learnt {
            let clouds = &sets[trained_on].train;
            let recipe = design.recipe(clouds.len(), seed);
            let epochs = recipe.epochs;
            let name = format!("{trained_on}-seed-{seed}");
            let model = networks.join(format!("{name}.safetensors"));
            once::network(&model, &name, recipe, clouds)?;
            let tests: BTreeSet<&Test> =
                design.tests.iter().filter(|test| test.trained_on == trained_on).collect();
            for Test { tested_on, .. } in tests {
                let found = confusion(&model, &sets[tested_on].test, &Options::default())?;
                let (correct, n) = (found.correct(), found.total());
                let train_clouds = clouds.len();
                csv.serialize(Answer {
                    trained_on,
                    tested_on,
                    seed,
                    correct,
                    n,
                    train_clouds,
                    epochs,
                })?;
            }
        }
    }
    Ok(atomic::write_bytes(&args.out.join("answers.csv"), csv.into_inner()?)?)
}

/// All that the answers depend on.
fn terms(design: &Design, sets: &BTreeMap<String, Halves>) -> anyhow::Result<String> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        sha256: BTreeMap<&'a str, String>,
        design: &'a Design,
    }
    let sha256 = sets.iter().map(|(name, halves)| (name.as_str(), halves.sha256())).collect();
    Ok(toml::to_string(&Terms { version: env!("CARGO_PKG_VERSION"), sha256, design })?)
}
