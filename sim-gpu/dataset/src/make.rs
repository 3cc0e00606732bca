use crate::config::Layout;
use crate::difference::difference;
use crate::error::DatasetError;
use crate::export_layouts::check_layouts;
use crate::finish::finish;
use crate::journal::{Journal, Terms};
use crate::layout;
use crate::manifest::{Manifest, is_plain};
use crate::pipeline::{is_current, scan_all};
use crate::plan::{Begin, Plan};
use crate::progress::{Progress, Stage};
use crate::record::Entry;
use crate::retract::retract;
use crate::verify::first_problem;
use formats::atomic;
use rayon::prelude::*;
use sim_gpu::Caster;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::Ordering::SeqCst;

/// Makes the dataset of `plan` and returns its manifest. A part has every N-th mesh of the plan;
/// [`merge()`](crate::merge()) makes one dataset of all parts.
///
/// The same settings, meshes and adapter give the same bytes, however often the run was
/// interrupted. A mesh that cannot be scanned is no error, but a failure that the manifest lists.
///
/// # Errors
/// - [`DatasetError::Occupied`], [`DatasetError::InTheWay`] or [`DatasetError::Different`] if the
///   folder holds files that [`Plan::begin`] does not allow; a complete dataset, of which a mesh or a
///   file was changed;
/// - settings that the layouts cannot hold, or effects that do not fit a sensor;
/// - [`DatasetError::Interrupted`] if [`Progress::stop`] was set before all meshes were scanned;
/// - a file that cannot be written, or an adapter that fails.
pub fn make(plan: &Plan, caster: &Caster, progress: &Progress) -> Result<Manifest, DatasetError> {
    if plan.config.layouts.contains(&Layout::Webdataset) {
        let cause = "expected a layout of files: `make_tars` makes tars";
        return Err(DatasetError::Layout { layout: Layout::Webdataset.name(), cause });
    }
    let (number, of) = plan.part.unwrap_or((0, 1));
    let meshes = plan.meshes.iter().skip(number as usize).step_by(of as usize);
    let meshes: Vec<MeshEntry> = meshes.cloned().collect();
    let classes: BTreeSet<String> = meshes.iter().map(|mesh| mesh.class.clone()).collect();
    check_layouts(plan.config, &Vec::from_iter(classes))?;
    let terms = Terms::new(plan.config.clone(), caster, &meshes, plan.part);
    if let Some(manifest) = begin(plan.out, &terms, plan.begin)? {
        check_finished(plan.out, &manifest, &meshes)?;
        return Ok(manifest);
    }
    progress.expected_meshes.store(meshes.len() as u64, SeqCst);
    let (records, failures) = scan_all(&Plan { meshes: &meshes, ..*plan }, caster, progress)?;
    progress.is_scanned.store(true, SeqCst);
    progress.time(Stage::Pack, || finish(plan.out, &terms, records, failures))
}

/// Begins a run on `terms` in `out`; returns the manifest if the dataset is complete already.
pub(crate) fn begin(
    out: &Path,
    terms: &Terms,
    how: Begin,
) -> Result<Option<Manifest>, DatasetError> {
    let journal = Journal::at(out);
    let finished = Manifest::read(&layout::manifest(out));
    match how {
        Begin::Fresh => refuse_occupied(out, terms)?,
        Begin::Overwrite if finished.is_ok() || journal.exists() => remove(out, terms)?,
        Begin::Overwrite => refuse_occupied(out, terms)?,
        Begin::Resume if journal.exists() => {
            same_terms(out, &journal.terms()?, terms)?;
            return Ok(None);
        }
        Begin::Resume => match finished {
            Ok(manifest) => {
                same_terms(out, &manifest.terms(), terms)?;
                // A run that was killed at its very end leaves parts of its journal and of the
                // files that it was writing.
                journal.remove()?;
                atomic::sweep_leftovers(out)?;
                return Ok(Some(manifest));
            }
            Err(_) => {
                journal.remove_empty()?;
                refuse_occupied(out, terms)?;
            }
        },
    }
    journal.begin(terms)?;
    Ok(None)
}

/// Checks that a complete dataset is of `meshes` as they are now, and that its files are there and as
/// they were written.
fn check_finished(
    out: &Path,
    manifest: &Manifest,
    meshes: &[MeshEntry],
) -> Result<(), DatasetError> {
    let hashing = manifest.config.hash;
    let records: BTreeMap<&Entry, _> = manifest.meshes.iter().map(|r| (&r.entry, r)).collect();
    let is_changed = |mesh: &&MeshEntry| {
        let record = records.get(&Entry::from(*mesh));
        record.is_some_and(|record| !is_current(record, mesh, hashing))
    };
    let changed = meshes.par_iter().find_first(is_changed);
    let changed = changed.map(|mesh| format!("{} has changed since", mesh.path.display()));
    match changed.or_else(|| first_problem(out, manifest).map(|problem| problem.to_string())) {
        None => Ok(()),
        Some(what) => {
            let cause = format!("the dataset is complete, but {what}: --overwrite makes it again");
            Err(DatasetError::malformed(out, cause))
        }
    }
}

fn refuse_occupied(out: &Path, terms: &Terms) -> Result<(), DatasetError> {
    let occupied = |what| Err(DatasetError::Occupied { path: out.into(), what });
    if Journal::at(out).exists() {
        return occupied("an unfinished dataset");
    }
    let manifest = layout::manifest(out);
    match Manifest::read(&manifest) {
        Ok(_) => return occupied("a dataset"),
        Err(DatasetError::NoManifest { .. }) => {}
        Err(DatasetError::Malformed { path, cause }) => {
            let what = format!("damaged, or of another program ({cause})");
            return Err(DatasetError::InTheWay { path, what });
        }
        Err(cause) => return Err(cause),
    }
    let names = layout::top_level(&terms.config);
    match names.iter().map(|name| out.join(name)).find(|path| path.exists()) {
        Some(path) => {
            let what = if path.is_dir() { "another folder" } else { "another file" };
            Err(DatasetError::InTheWay { path, what: what.to_owned() })
        }
        None => Ok(()),
    }
}

/// Removes the files of the dataset in `out`, and no other files beside them.
fn remove(out: &Path, terms: &Terms) -> Result<(), DatasetError> {
    let mut names = layout::top_level(&terms.config);
    if let Ok(manifest) = Manifest::read(&layout::manifest(out)) {
        names.extend(layout::top_level(&manifest.config));
    } else if let Ok(begun) = Journal::at(out).terms() {
        names.extend(layout::top_level(&begun.config));
    }
    retract(out)?;
    // The set names of a damaged journal must not lead out of the folder.
    names.iter().filter(|name| is_plain(name)).try_for_each(|name| layout::remove(&out.join(name)))
}

fn same_terms(out: &Path, begun: &Terms, asked: &Terms) -> Result<(), DatasetError> {
    match difference(begun, asked) {
        None => Ok(()),
        Some(difference) => Err(DatasetError::Different { path: out.into(), difference }),
    }
}
