use crate::config::DatasetConfig;
use crate::difference::difference;
use crate::error::DatasetError;
use crate::finish::complete;
use crate::folder::{DatasetFolder, remove};
use crate::manifest::Manifest;
use crate::record::Entry;
use crate::verify::first_problem;
use formats::atomic;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Merges `shards`, which are all parts of one dataset, into `out`, which must be empty or absent.
/// Scans are hard-linked if the file system allows it and copied otherwise. The result has the
/// same bytes as one run over all meshes.
///
/// On failure `out` is emptied again. A process that is killed leaves files, but no manifest.
///
/// # Errors
/// Shards that do not make one dataset, are not finished or have a file that was changed; a file that cannot be read or written.
pub fn merge(shards: &[PathBuf], out: &Path) -> Result<Manifest, DatasetError> {
    let shards: Vec<Shard> =
        shards.iter().map(|path| Shard::read(path)).collect::<Result<_, _>>()?;
    check_parts(&shards.iter().map(Shard::part).collect::<Vec<_>>(), out)?;
    check_entries(&shards)?;
    for Shard { path, manifest, .. } in &shards {
        if let Some(problem) = first_problem(DatasetFolder(path), manifest) {
            return Err(DatasetError::malformed(path, problem));
        }
    }
    let merged = shards.iter().try_for_each(|shard| link_scans(shard, out));
    let merged = merged.and_then(|()| complete(DatasetFolder(out), union(shards)));
    if merged.is_err() {
        // The first error is returned; the files that are left have no manifest.
        let _ = empty(out);
    }
    merged
}

struct Shard {
    path: PathBuf,
    manifest: Manifest,
    number: u32,
    of: u32,
}

/// What a shard says of itself.
pub struct Part<'a, Settings> {
    /// Its folder.
    pub path: &'a Path,
    /// Its number, from 0.
    pub number: u32,
    /// The number of all parts.
    pub of: u32,
    /// The version of Edgepuck that made it.
    pub version: &'a str,
    /// What all parts have in common.
    pub settings: &'a Settings,
}

impl Shard {
    fn read(path: &Path) -> Result<Self, DatasetError> {
        let folder = DatasetFolder(path);
        if folder.is_begun() {
            return Err(DatasetError::Unfinished { path: path.into() });
        }
        let manifest = folder.manifest()?;
        let Some((number, of)) = manifest.shard else {
            return Err(DatasetError::malformed(
                path,
                "expected a shard, found a dataset that was made without --shard",
            ));
        };
        Ok(Self { path: path.into(), manifest, number, of })
    }

    fn part(&self) -> Part<'_, DatasetConfig> {
        let Self { path, manifest: Manifest { version, config, .. }, number, of } = self;
        Part { path, number: *number, of: *of, version, settings: config }
    }
}

/// Checks that `parts` are all parts of one whole, which can be written to the folder `out`.
pub fn check_parts(parts: &[Part<'_, impl Serialize>], out: &Path) -> Result<(), DatasetError> {
    let ours = env!("CARGO_PKG_VERSION");
    for Part { path, of, version, settings, .. } in parts {
        if *version != ours {
            let cause = format!("was made by version {version}; this is {ours}");
            return Err(DatasetError::malformed(path, cause));
        }
        let first = &parts[0];
        if *of != first.of {
            let cause = format!("is one of {of}; {} is one of {}", first.path.display(), first.of);
            return Err(DatasetError::malformed(path, cause));
        }
        if let Some(difference) = difference(settings, first.settings) {
            let cause = format!("differs from {}: {difference}", first.path.display());
            return Err(DatasetError::malformed(path, cause));
        }
    }
    check_numbers(parts, out)?;
    check_empty(out)
}

/// Checks that each part occurs exactly once.
fn check_numbers<Settings>(parts: &[Part<'_, Settings>], out: &Path) -> Result<(), DatasetError> {
    let mut seen = BTreeMap::new();
    for part in parts {
        if let Some(first) = seen.insert(part.number, part.path) {
            let cause = format!("is the same part as {}", first.display());
            return Err(DatasetError::malformed(part.path, cause));
        }
    }
    let of = parts.first().map_or(1, |part| part.of);
    match (0..of).find(|number| !seen.contains_key(number)) {
        Some(number) => {
            // The command line counts from 1.
            Err(DatasetError::malformed(
                out,
                format!("part {}/{of} is not among the shards", number + 1),
            ))
        }
        None => Ok(()),
    }
}

fn check_entries(parts: &[Shard]) -> Result<(), DatasetError> {
    let mut seen = BTreeMap::new();
    for part in parts {
        for entry in part.manifest.entries() {
            if let Some(first) = seen.insert(entry, &part.path) {
                let Entry { split, .. } = entry;
                let cause = format!("{} ({split}) is also in {}", entry.id(), first.display());
                return Err(DatasetError::malformed(&part.path, cause));
            }
        }
    }
    Ok(())
}

fn check_empty(out: &Path) -> Result<(), DatasetError> {
    match fs::read_dir(out).map(|mut items| items.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => {
            Err(DatasetError::malformed(out, "holds files already; merge into an empty folder"))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(DatasetError::io(out, error)),
    }
}

/// Links or copies all scans of one shard into `out`.
fn link_scans(part: &Shard, out: &Path) -> Result<(), DatasetError> {
    let files: Vec<PathBuf> = part.manifest.scan_files().map(|(file, ..)| file).collect();
    files.par_iter().try_for_each(|file| link(&part.path.join(file), &out.join(file)))
}

/// Makes `to` the same file as `from`, or else a copy of it.
pub fn link(from: &Path, to: &Path) -> Result<(), DatasetError> {
    atomic::make_folder_of(to)?;
    if fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let mut scan = File::open(from).map_err(|error| DatasetError::io(from, error))?;
    Ok(atomic::write(to, |copy| io::copy(&mut scan, copy).map(|_| ()))?)
}

/// The manifest of the whole, without poses, packed files and layouts.
fn union(parts: Vec<Shard>) -> Manifest {
    let mut manifests = parts.into_iter().map(|part| part.manifest);
    let mut whole = manifests.next().expect("invariant: check_numbers wants one part at least");
    whole.shard = None;
    for manifest in manifests {
        whole.adapters.extend(manifest.adapters);
        whole.meshes.extend(manifest.meshes);
        whole.failures.extend(manifest.failures);
    }
    whole.adapters.sort();
    whole.adapters.dedup();
    whole
}

fn empty(out: &Path) -> Result<(), DatasetError> {
    let here = |error| DatasetError::io(out, error);
    for item in fs::read_dir(out).map_err(here)? {
        remove(&item.map_err(here)?.path())?;
    }
    Ok(())
}
