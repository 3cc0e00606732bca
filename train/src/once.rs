//! What a run keeps, so that one that was interrupted goes on: networks that are
//! trained once, and the terms on which they were.

use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use formats::atomic;
use train::clouds::Clouds;
use train::recipe::Recipe;

use crate::run::Job;

/// Trains the network called `name` by `recipe` on `clouds` and writes it to
/// `out`, unless it is there.
///
/// # Errors
/// Another recipe under that name; what training reports.
pub fn network(out: &Path, name: &str, recipe: Recipe, clouds: &Clouds) -> anyhow::Result<()> {
    if out.is_file() {
        let trained = Recipe::read(&out.with_extension("run").join("recipe.toml"))?;
        ensure!(trained == recipe, "{}: was trained by another recipe", out.display());
        return Ok(());
    }
    eprintln!("training {name}: {} clouds, {} points", clouds.len(), recipe.points);
    let job = Job { recipe, clouds, data: name, data_name: name, out };
    job.run(None).with_context(|| format!("cannot train {name}"))
}

/// Keeps `terms`, all that the results in the folder `out` depend on.
///
/// # Errors
/// Other terms than those of an earlier run.
pub fn keep_terms(terms: &str, out: &Path) -> anyhow::Result<()> {
    let path = out.join("terms.toml");
    if path.is_file() {
        let earlier = fs::read_to_string(&path)?;
        ensure!(
            earlier == terms,
            "{}: an earlier run had another plan or other data; choose another --out",
            path.display()
        );
        return Ok(());
    }
    Ok(atomic::write_bytes(&path, terms)?)
}
