//! What an unfinished run has done: one small file per mesh, written when all
//! of its scans are there. A run that was killed goes on from these.

use super::config::DatasetConfig;
use super::error::DatasetError;
use super::layout;
use super::record::{Entry, MeshRecord};
use formats::atomic;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What must agree for a run to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Terms {
    /// The tool's version.
    pub version: String,
    /// What the dataset is to hold.
    pub config: DatasetConfig,
    /// The adapter's name.
    pub adapter: String,
    /// Which meshes: a digest of their entries and the names of their files.
    pub meshes: String,
    /// Which part of the meshes: (number from 0, of how many).
    pub shard: Option<(u32, u32)>,
}

impl Terms {
    /// The terms of a run over `meshes`, or over part `shard` of them.
    #[must_use]
    pub fn new(
        config: DatasetConfig,
        caster: &OpenCaster,
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

/// Says which meshes a run is about, whatever is in their files.
#[must_use]
pub(super) fn digest<'a>(meshes: impl Iterator<Item = (Entry, &'a str)>) -> String {
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
    /// The journal of the dataset in `out`, which need not have one.
    #[must_use]
    pub fn of(out: &Path) -> Self {
        Self { folder: layout::journal(out) }
    }

    /// Whether a run was begun and not finished.
    #[must_use]
    pub fn exists(&self) -> bool {
        self.terms_file().exists()
    }

    /// Begins a journal.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin(&self, terms: &Terms) -> Result<(), DatasetError> {
        write_json(&self.terms_file(), terms)
    }

    /// The terms of the run that was begun.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn terms(&self) -> Result<Terms, DatasetError> {
        read_json(&self.terms_file())
    }

    /// The record of `entry`; `None` if its scans are not all there.
    ///
    /// # Errors
    /// If there is a record that cannot be read.
    pub fn find(&self, entry: &Entry) -> Result<Option<MeshRecord>, DatasetError> {
        let file = self.record_file(entry);
        if file.exists() { read_json(&file).map(Some) } else { Ok(None) }
    }

    /// Notes that all scans of a mesh are there.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(&self, record: &MeshRecord) -> Result<(), DatasetError> {
        write_json(&self.record_file(&record.entry), record)
    }

    /// Removes the journal of a finished run. If it is killed meanwhile, what
    /// remains is no journal, and is removed when this is called again.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn remove(&self) -> Result<(), DatasetError> {
        layout::remove(&self.terms_file())?;
        layout::remove(&self.folder)
    }

    fn terms_file(&self) -> PathBuf {
        self.folder.join("terms.json")
    }

    fn record_file(&self, entry: &Entry) -> PathBuf {
        let Entry { class, split, name } = entry;
        self.folder.join("meshes").join(class).join(split.name()).join(format!("{name}.json"))
    }
}

/// Reads a JSON file.
pub(super) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    let text = std::fs::read(file).map_err(|error| DatasetError::io(file, error))?;
    serde_json::from_slice(&text)
        .map_err(|error| DatasetError::Malformed { path: file.into(), cause: error.to_string() })
}

/// Writes a JSON file, whole or not at all.
pub(super) fn write_json<T: Serialize>(file: &Path, value: &T) -> Result<(), DatasetError> {
    let text = serde_json::to_vec_pretty(value)
        .map_err(|error| DatasetError::Malformed { path: file.into(), cause: error.to_string() })?;
    atomic::write(file, |out| {
        out.write_all(&text)?;
        out.write_all(b"\n")
    })?;
    Ok(())
}
