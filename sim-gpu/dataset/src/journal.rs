//! The journal of an unfinished run: one small file for each mesh, written when all of its scans
//! are there. A run that was killed is resumed from these files.

use crate::config::DatasetConfig;
use crate::error::DatasetError;
use crate::layout;
use crate::record::{Entry, MeshRecord};
use formats::atomic;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sim_gpu::Caster;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::path::{Path, PathBuf};

/// The conditions of a run. A run is resumed only if they are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Terms {
    /// The tool's version.
    pub version: String,
    /// The settings of the dataset.
    pub config: DatasetConfig,
    /// The adapter's name.
    pub adapter: String,
    /// A digest of the entries of the meshes and of the names of their files.
    pub meshes: String,
    /// The part of the meshes: (number from 0, number of parts).
    pub shard: Option<(u32, u32)>,
}

impl Terms {
    /// The terms of a run over `meshes`, or over part `shard` of them.
    pub(crate) fn new(
        config: DatasetConfig,
        caster: &Caster,
        meshes: &[MeshEntry],
        shard: Option<(u32, u32)>,
    ) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            config,
            adapter: caster.name().to_owned(),
            meshes: digest(meshes.iter().map(|mesh| (mesh.into(), mesh.relative.as_str()))),
            shard,
        }
    }
}

/// A digest of the meshes of a run, which does not depend on the contents of their files.
pub(crate) fn digest<'a>(meshes: impl Iterator<Item = (Entry, &'a str)>) -> String {
    let mut lines: Vec<String> = meshes
        .map(|(Entry { class, split, name }, source)| format!("{class}/{split}/{name} {source}\n"))
        .collect();
    lines.sort_unstable();
    formats::hash::of_bytes(lines.concat().as_bytes())
}

/// The journal of one folder.
#[derive(Clone, Debug)]
pub struct Journal {
    folder: PathBuf,
}

impl Journal {
    /// The journal of the dataset in `out`, whether it exists or not.
    #[must_use]
    pub fn at(out: &Path) -> Self {
        Self { folder: layout::journal(out) }
    }

    /// Whether a run was begun and not finished.
    #[must_use]
    pub fn exists(&self) -> bool {
        self.terms_file().exists()
    }

    /// Begins a journal.
    pub fn begin(&self, terms: &Terms) -> Result<(), DatasetError> {
        write_json(&self.terms_file(), terms)
    }

    /// The terms of the run that was begun.
    pub fn terms(&self) -> Result<Terms, DatasetError> {
        read_json(&self.terms_file())
    }

    /// The record of `entry`, or `None` if some of its scans are missing.
    pub fn find(&self, entry: &Entry) -> Result<Option<MeshRecord>, DatasetError> {
        let file = self.record_file(entry);
        if file.exists() { read_json(&file).map(Some) } else { Ok(None) }
    }

    /// Records that all scans of a mesh are there.
    pub fn note(&self, record: &MeshRecord) -> Result<(), DatasetError> {
        write_json(&self.record_file(&record.entry), record)
    }

    /// Removes the journal of a finished run, its terms first: if the process is killed meanwhile,
    /// [`Journal::exists`] is false already, and the next call removes the rest.
    pub fn remove(&self) -> Result<(), DatasetError> {
        layout::remove(&self.terms_file())?;
        layout::remove(&self.folder)
    }

    /// Removes the folder that a run leaves without terms if it is killed at its very beginning.
    /// One with other files stays.
    pub fn remove_empty(&self) -> Result<(), DatasetError> {
        atomic::sweep_leftovers(&self.folder)?;
        // It may be absent, or hold files of the user.
        let _ = std::fs::remove_dir(&self.folder);
        Ok(())
    }

    fn terms_file(&self) -> PathBuf {
        self.folder.join("terms.json")
    }

    fn record_file(&self, entry: &Entry) -> PathBuf {
        let Entry { class, split, name } = entry;
        self.folder.join("meshes").join(class).join(split.name()).join(format!("{name}.json"))
    }
}

pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    let text = std::fs::read(file).map_err(|error| DatasetError::io(file, error))?;
    serde_json::from_slice(&text).map_err(|error| DatasetError::malformed(file, error))
}

/// Writes a JSON file, whole or not at all.
pub(crate) fn write_json<T: Serialize>(file: &Path, value: &T) -> Result<(), DatasetError> {
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|error| DatasetError::malformed(file, error))?;
    text.push(b'\n');
    Ok(atomic::write_bytes(file, text)?)
}
