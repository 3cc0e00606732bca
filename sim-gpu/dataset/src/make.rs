use crate::config::Layout;
use crate::error::DatasetError;
use crate::finish::finish;
use crate::folder::DatasetFolder;
use crate::manifest::Manifest;
use crate::pipeline::{is_current, scan_all};
use crate::plan::{Plan, Terms};
use crate::progress::{Progress, Stage};
use crate::record::Entry;
use crate::verify::first_problem;
use edgepuck_mesh::tree::MeshEntry;
use rayon::prelude::*;
use sim_gpu::Caster;
use std::collections::BTreeMap;
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
    plan.config.check()?;
    let (folder, terms) = (DatasetFolder(plan.out), Terms::new(plan, &meshes, caster));
    if let Some(manifest) = folder.begin(&terms, plan.begin)? {
        check_finished(folder, &manifest, &meshes)?;
        return Ok(manifest);
    }
    progress.expected_meshes.store(meshes.len() as u64, SeqCst);
    let (records, failures) = scan_all(&Plan { meshes: &meshes, ..*plan }, caster, progress)?;
    progress.is_scanned.store(true, SeqCst);
    progress.time(Stage::Pack, || finish(folder, &terms, records, failures))
}

/// Checks that a complete dataset is of `meshes` as they are now, and that its files are there and as
/// they were written.
fn check_finished(
    folder: DatasetFolder,
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
    match changed.or_else(|| first_problem(folder, manifest).map(|problem| problem.to_string())) {
        None => Ok(()),
        Some(what) => {
            let cause = format!("the dataset is complete, but {what}: --overwrite makes it again");
            Err(DatasetError::malformed(folder.0, cause))
        }
    }
}
