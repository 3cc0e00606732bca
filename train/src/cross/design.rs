//! Which sets are learnt from, and which are tested on.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use train::recipe::Recipe;

/// What a TOML file asks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// A network each.
    pub seeds: Vec<u64>,
    /// Steps of every training, whatever the size of its set.
    pub steps: u32,
    /// How all are trained; seed and epochs are replaced.
    pub recipe: Recipe,
    /// The sets.
    #[serde(rename = "set")]
    pub sets: Vec<Set>,
    /// Which network is tested on what.
    #[serde(rename = "test")]
    pub tests: Vec<Test>,
}

/// One set of clouds, in two halves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Set {
    /// What tests call it.
    pub name: String,
    /// Where it lies, from the design's folder; as `train --data` takes it.
    pub path: PathBuf,
    /// Of the matched sets only clouds are used whose names all of them have.
    pub matched: bool,
}

/// One network and what it answers on one set.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Test {
    /// The set that it learns from.
    pub trained_on: String,
    /// The set that it is tested on.
    pub tested_on: String,
}

impl Design {
    /// Reads the design at `path`.
    ///
    /// # Errors
    /// A file that is no design, with the key and the cause.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
        let design: Self = toml::from_str(&text).with_context(|| format!("{name}: no design"))?;
        design.recipe.check().with_context(|| name.clone())?;
        design.check().with_context(|| name)?;
        Ok(design)
    }

    fn check(&self) -> anyhow::Result<()> {
        ensure!(!self.seeds.is_empty(), "seeds: none");
        let distinct: BTreeSet<u64> = self.seeds.iter().copied().collect();
        ensure!(distinct.len() == self.seeds.len(), "seeds: one is there twice");
        ensure!(self.steps > 0, "steps: 0");
        ensure!(!self.tests.is_empty(), "test: none");
        let names: BTreeSet<&str> = self.sets.iter().map(|set| set.name.as_str()).collect();
        ensure!(names.len() == self.sets.len(), "set: one name is there twice");
        for name in &names {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
            ensure!(!name.is_empty() && name.chars().all(plain), "set: {name:?} names no file");
        }
        for name in self.tests.iter().flat_map(|test| [&test.trained_on, &test.tested_on]) {
            ensure!(names.contains(name.as_str()), "test: there is no set {name:?}");
        }
        Ok(())
    }

    /// The recipe for `clouds` clouds: as many epochs as come nearest above the
    /// steps.
    pub fn recipe(&self, clouds: usize, seed: u64) -> Recipe {
        let a_epoch = (clouds / self.recipe.batch).max(1) as u32;
        Recipe { seed, epochs: self.steps.div_ceil(a_epoch), ..self.recipe.clone() }
    }
}
