//! The files that let an interrupted study be resumed: networks, which are trained once, results, and
//! the terms of the study.

use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use formats::atomic;
use serde::Serialize;
use serde::de::DeserializeOwned;
use train::clouds::Clouds;
use train::recipe::Recipe;
use train::run::{Job, Progress};

/// Trains the network `name` by `recipe` on `clouds` and writes it to `out`, unless it exists.
pub fn network(out: &Path, name: &str, recipe: Recipe, clouds: &Clouds) -> anyhow::Result<()> {
    if out.is_file() {
        let trained = Recipe::read(&out.with_extension("run").join("recipe.toml"))?;
        ensure!(
            trained == recipe,
            "{}: expected a network of this recipe, found one of another",
            out.display()
        );
        return Ok(());
    }
    eprintln!("training {name}: {} clouds, {} points", clouds.len(), recipe.points);
    let job = Job { recipe, clouds, data: name, data_name: name, out, overwrite: false };
    let mut report = |progress: Progress<'_>| {
        if let Progress::Epoch(epoch) = progress {
            eprintln!("{epoch}");
        }
    };
    job.run(None, &mut report).map(|_| ()).with_context(|| format!("cannot train {name}"))
}

/// `recipe` with the fewest epochs that have at least `steps` steps on `clouds` clouds.
pub fn of_steps(recipe: Recipe, steps: u32, clouds: usize) -> Recipe {
    let each = (clouds / recipe.batch).max(1) as u32;
    Recipe { epochs: steps.div_ceil(each).max(1), ..recipe }
}

/// The result in the JSON file at `path`, or the result of `make`, which is written there.
pub fn result<T: Serialize + DeserializeOwned>(
    path: &Path,
    make: impl FnOnce() -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    if path.is_file() {
        let text = fs::read_to_string(path)?;
        return serde_json::from_str(&text).with_context(|| path.display().to_string());
    }
    let result = make()?;
    atomic::write_bytes(path, serde_json::to_string(&result)?)?;
    Ok(result)
}

/// Writes `terms`, all that the results depend on, to `path`, unless an earlier run
/// has written the same.
pub fn keep_terms(terms: &str, path: &Path) -> anyhow::Result<()> {
    if path.is_file() {
        ensure!(
            fs::read_to_string(path)? == terms,
            "{}: an earlier run had another plan or other data; choose another --out",
            path.display()
        );
        return Ok(());
    }
    Ok(atomic::write_bytes(path, terms)?)
}
