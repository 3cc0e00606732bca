//! The sets that networks are trained on, and those that they are tested on.

use super::datasets::clouds;
use super::effects::{DATASETS, Source};
use super::folder;
use super::plan::Plan;
use super::rows::{self, Test};
use serde::Serialize;
use std::path::{Path, PathBuf};
use train::recipe::Recipe;

/// Trainings and tests.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// One network of each set is trained with each of these.
    pub seeds: Vec<u64>,
    /// Steps of every training, whatever the size of its set.
    pub steps: u32,
    /// How all are trained. Seed and epochs are replaced.
    pub recipe: Recipe,
    /// The sets.
    #[serde(rename = "set")]
    pub sets: Vec<Set>,
    /// Which network is tested on what.
    #[serde(rename = "test")]
    pub tests: Vec<Test>,
}

/// One set of clouds, split into training and test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Set {
    /// What tests call it.
    pub name: &'static str,
    /// Where it lies, relative to the study's folder, as `train --data` takes it.
    pub path: PathBuf,
    /// Whether only clouds are used whose names all matched sets have.
    pub matched: bool,
}

impl Design {
    /// The trainings and tests that the effects' comparison needs, by `plan`.
    pub fn of(plan: &Plan) -> Self {
        let tests = rows::tests();
        let used =
            |name| tests.iter().any(|test| [test.trained_on, test.tested_on].contains(&name));
        let set = |&(name, source): &(&'static str, Source)| Set {
            name,
            path: clouds(source, &folder(Path::new(""), name)),
            // Whole meshes have no views to be matched by.
            matched: source != Source::Surface,
        };
        Self {
            seeds: plan.seeds.clone(),
            steps: plan.steps,
            recipe: plan.recipe.clone(),
            sets: DATASETS.iter().filter(|(name, _)| used(name)).map(set).collect(),
            tests,
        }
    }

    /// The recipe for `clouds` clouds: the fewest epochs with at least the steps
    /// of the design.
    pub fn recipe(&self, clouds: usize, seed: u64) -> Recipe {
        let steps_per_epoch = (clouds / self.recipe.batch).max(1) as u32;
        Recipe { seed, epochs: self.steps.div_ceil(steps_per_epoch), ..self.recipe.clone() }
    }
}
