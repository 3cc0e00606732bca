//! What a study keeps, so that an interrupted run can be resumed: networks, which
//! are trained once, and the terms of the study.

use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use formats::atomic;
use train::clouds::Clouds;
use train::recipe::Recipe;
use train::run::Job;

/// Trains the network called `name` by `recipe` on `clouds` and writes it to
/// `out`, unless it is there.
///
/// # Errors
/// A network of another recipe under that name; what training reports.
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
    let job = Job { recipe, clouds, data: name, data_name: name, out };
    job.run(None).map(|_| ()).with_context(|| format!("cannot train {name}"))
}

/// Writes `terms`, all that the results in the folder `out` depend on, unless an
/// earlier run has written the same.
///
/// # Errors
/// Terms that differ from those of an earlier run.
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
