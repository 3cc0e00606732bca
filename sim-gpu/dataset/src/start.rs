//! How a run begins: in an empty folder, or where another one was stopped.

use super::difference::difference;
use super::error::DatasetError;
use super::journal::{Journal, Terms};
use super::layout;
use super::manifest::{Manifest, is_plain};
use super::publish::retract;
use formats::atomic;
use std::path::Path;

/// What to do where the folder holds a dataset already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Refuse.
    Fresh,
    /// Go on with it.
    Resume,
    /// Remove it first.
    Overwrite,
}

/// What is left to do.
#[derive(Debug)]
pub enum Start {
    /// The meshes that the journal lacks.
    Go,
    /// Nothing: the dataset is complete.
    Complete(Box<Manifest>),
}

/// Begins a run on `terms` in `out`.
///
/// # Errors
/// If the folder holds what `how` does not allow, or was begun on other terms.
pub fn begin(out: &Path, terms: &Terms, how: Begin) -> Result<Start, DatasetError> {
    let journal = Journal::of(out);
    let finished = layout::manifest(out).exists();
    match how {
        Begin::Fresh => refuse_occupied(out, terms)?,
        Begin::Overwrite if finished || journal.exists() => remove(out, terms)?,
        Begin::Overwrite => refuse_occupied(out, terms)?,
        Begin::Resume if journal.exists() => {
            same_terms(out, &journal.terms()?, terms)?;
            return Ok(Start::Go);
        }
        Begin::Resume if finished => {
            let manifest = Manifest::read(&layout::manifest(out))?;
            same_terms(out, &manifest.terms(), terms)?;
            // A run killed at its very end leaves parts of its journal, and of
            // what it was writing.
            journal.remove()?;
            atomic::sweep_leftovers(out)?;
            return Ok(Start::Complete(Box::new(manifest)));
        }
        Begin::Resume => {
            // A run killed at its very beginning leaves a journal without terms.
            journal.remove()?;
            refuse_occupied(out, terms)?;
        }
    }
    journal.begin(terms)?;
    Ok(Start::Go)
}

fn refuse_occupied(out: &Path, terms: &Terms) -> Result<(), DatasetError> {
    let what = if layout::journal(out).exists() {
        "an unfinished dataset"
    } else if layout::manifest(out).exists() {
        "a dataset"
    } else if layout::top_level(&terms.config).iter().any(|name| out.join(name).exists()) {
        "files where a dataset's would go"
    } else {
        return Ok(());
    };
    Err(DatasetError::Occupied { path: out.into(), what })
}

/// Removes what a dataset holds, and nothing else that may lie beside it.
fn remove(out: &Path, terms: &Terms) -> Result<(), DatasetError> {
    let mut names = layout::top_level(&terms.config);
    let manifest = layout::manifest(out);
    if manifest.exists() {
        names.extend(layout::top_level(&Manifest::read(&manifest)?.config));
    } else if let Ok(begun) = Journal::of(out).terms() {
        names.extend(layout::top_level(&begun.config));
    }
    retract(out)?;
    // What a damaged journal calls a set must not lead out of the folder.
    names.iter().filter(|name| is_plain(name)).try_for_each(|name| layout::remove(&out.join(name)))
}

/// Names the first setting that differs.
fn same_terms(out: &Path, begun: &Terms, asked: &Terms) -> Result<(), DatasetError> {
    match difference(begun, asked) {
        None => Ok(()),
        Some(difference) => Err(DatasetError::Different { path: out.into(), difference }),
    }
}
