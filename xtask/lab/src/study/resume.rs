//! The files that let an interrupted study be resumed: networks, which are trained once, and the terms
//! of the study.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use formats::atomic;
use train::clouds::Clouds;
use train::recipe::Recipe;
use train::run::{Job, Progress};

/// Trains the network `name` by `recipe` on `clouds` and writes it to `out`, unless it exists.
pub fn network(out: &Path, name: &str, recipe: Recipe, clouds: &Clouds) -> anyhow::Result<()> {
    if out.is_file() {
        let trained = Recipe::read(&recipe_file(out))?;
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
            eprintln!("{name}: {epoch}");
        }
    };
    job.run(None, &mut report).map(|_| ()).with_context(|| format!("cannot train {name}"))
}

/// The file with the recipe of the run that trained `out`, if this program trained it.
pub fn recipe_file(out: &Path) -> PathBuf {
    out.with_extension("run").join("recipe.toml")
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
