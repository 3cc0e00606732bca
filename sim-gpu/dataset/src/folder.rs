//! The folder of a dataset of files: the settings, the journal of a run that is not finished, and the
//! manifest of one that is.
//!
//! The journal has one small file for each mesh, written when all of its scans are there. A run that was
//! killed is resumed from these files.

use crate::config::DatasetConfig;
use crate::difference::difference;
use crate::error::DatasetError;
use crate::manifest::{Manifest, is_plain};
use crate::plan::{Begin, Terms};
use crate::record::{Entry, MeshFailure, MeshRecord};
use formats::atomic;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The card and the metadata of a published dataset.
pub(crate) const PUBLISHED: [&str; 2] = ["README.md", "croissant.json"];

/// The end of a card, by which [`DatasetFolder::retract`] recognises it.
pub(crate) const END_OF_CARD: &str = "<!-- Written by `edgepuck gen-dataset --card`. -->\n";

/// The folder of a dataset, finished or not, which need not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatasetFolder<'a>(pub &'a Path);

impl<'a> DatasetFolder<'a> {
    /// The path of the manifest, which only a finished dataset has.
    #[must_use]
    pub fn manifest_file(self) -> PathBuf {
        self.0.join("manifest.json")
    }

    /// The path of the list of meshes that could not be scanned. It exists only if there are some.
    #[must_use]
    pub fn failures_file(self) -> PathBuf {
        self.0.join("failures.jsonl")
    }

    /// The path of the example picture.
    #[must_use]
    pub fn picture_file(self) -> PathBuf {
        self.0.join("example.png")
    }

    /// Reads the manifest.
    ///
    /// # Errors
    /// [`DatasetError::NoManifest`] if the folder has no manifest. Other errors if the manifest cannot be
    /// read, another tool wrote it, or a name in it leads out of the folder.
    pub fn manifest(self) -> Result<Manifest, DatasetError> {
        let path = self.manifest_file();
        if !path.exists() {
            return Err(DatasetError::NoManifest { path });
        }
        let manifest: Manifest = read_json(&path)?;
        match manifest.flaw() {
            None => Ok(manifest),
            Some(cause) => Err(DatasetError::malformed(&path, cause)),
        }
    }

    /// Writes the manifest, atomically, and removes the journal.
    ///
    /// # Errors
    /// A file that cannot be written or removed.
    pub fn close(self, manifest: &Manifest) -> Result<(), DatasetError> {
        write_json(&self.manifest_file(), manifest)?;
        self.remove_journal()
    }

    /// Removes the manifest and the files that [`finish`](crate::finish) derives from the scans, and
    /// writes the list of `failures`.
    pub(crate) fn reopen(self, failures: &[MeshFailure]) -> Result<(), DatasetError> {
        remove(&self.manifest_file())?;
        remove(&self.0.join("packed"))?;
        atomic::sweep_leftovers(self.0)?;
        match failures {
            [] => remove(&self.failures_file()),
            failures => Ok(atomic::write_bytes(&self.failures_file(), failure_lines(failures))?),
        }
    }

    /// Begins a run on `terms`; returns the manifest if the dataset is complete already.
    pub(crate) fn begin(self, terms: &Terms, how: Begin) -> Result<Option<Manifest>, DatasetError> {
        let (is_begun, finished) = (self.is_begun(), self.manifest());
        match (how, finished) {
            (Begin::Resume, _) if is_begun => {
                self.same_terms(&self.terms()?, terms)?;
                return Ok(None);
            }
            (Begin::Resume, Ok(manifest)) => {
                self.same_terms(&manifest.terms(), terms)?;
                // A run that was killed at its very end leaves parts of its journal and of the files
                // that it was writing.
                self.remove_journal()?;
                atomic::sweep_leftovers(self.0)?;
                return Ok(Some(manifest));
            }
            (Begin::Overwrite, finished) if is_begun || finished.is_ok() => {
                let old = finished.map(|manifest| manifest.config);
                self.clear(&terms.config, old.or_else(|_| Ok(self.terms()?.config)))?;
            }
            (how, finished) => {
                if how == Begin::Resume {
                    self.remove_empty_journal()?;
                }
                self.must_be_free(&terms.config, finished)?;
            }
        }
        self.write_terms(terms)?;
        Ok(None)
    }

    /// Checks that nothing stands where the files of a dataset of `config` would go.
    fn must_be_free(
        self,
        config: &DatasetConfig,
        finished: Result<Manifest, DatasetError>,
    ) -> Result<(), DatasetError> {
        let occupied = |what| Err(DatasetError::Occupied { path: self.0.into(), what });
        match finished {
            _ if self.is_begun() => return occupied("an unfinished dataset"),
            Ok(_) => return occupied("a dataset"),
            Err(DatasetError::NoManifest { .. }) => {}
            Err(DatasetError::Malformed { path, cause }) => {
                let what = format!("damaged, or of another program ({cause})");
                return Err(DatasetError::InTheWay { path, what });
            }
            Err(cause) => return Err(cause),
        }
        match top_level(config).iter().map(|name| self.0.join(name)).find(|path| path.exists()) {
            Some(path) => {
                let what = if path.is_dir() { "another folder" } else { "another file" };
                Err(DatasetError::InTheWay { path, what: what.to_owned() })
            }
            None => Ok(()),
        }
    }

    /// Removes the files of a dataset of `config` and of the `old` one, and no other files beside them.
    fn clear(
        self,
        config: &DatasetConfig,
        old: Result<DatasetConfig, DatasetError>,
    ) -> Result<(), DatasetError> {
        self.retract()?;
        let names = top_level(config).into_iter().chain(old.iter().flat_map(top_level));
        // The set names of a damaged journal must not lead out of the folder.
        names.filter(|name| is_plain(name)).try_for_each(|name| remove(&self.0.join(name)))
    }

    fn same_terms(self, begun: &Terms, asked: &Terms) -> Result<(), DatasetError> {
        match difference(begun, asked) {
            None => Ok(()),
            Some(difference) => Err(DatasetError::Different { path: self.0.into(), difference }),
        }
    }

    /// Removes the card and the metadata, since they do not describe the dataset that will replace this
    /// one. A `README.md` that [`publish()`](crate::publish()) did not write stays.
    pub(crate) fn retract(self) -> Result<(), DatasetError> {
        let [card, metadata] = PUBLISHED.map(|name| self.0.join(name));
        if !metadata.exists() {
            return Ok(());
        }
        remove(&metadata)?;
        match fs::read_to_string(&card) {
            Ok(text) if text.ends_with(END_OF_CARD) => remove(&card),
            _ => Ok(()),
        }
    }

    /// Whether a run was begun and not finished.
    #[must_use]
    pub fn is_begun(self) -> bool {
        self.terms_file().exists()
    }

    /// The terms of the run that was begun.
    fn terms(self) -> Result<Terms, DatasetError> {
        read_json(&self.terms_file())
    }

    /// Begins a journal.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_terms(self, terms: &Terms) -> Result<(), DatasetError> {
        write_json(&self.terms_file(), terms)
    }

    /// The record of `entry` in the journal, or `None` if some of its scans are missing.
    pub(crate) fn find(self, entry: &Entry) -> Result<Option<MeshRecord>, DatasetError> {
        let file = self.record_file(entry);
        if file.exists() { read_json(&file).map(Some) } else { Ok(None) }
    }

    /// Notes in the journal that all scans of a mesh are there.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn note(self, record: &MeshRecord) -> Result<(), DatasetError> {
        write_json(&self.record_file(&record.entry), record)
    }

    /// Removes the journal of a finished run, its terms first: if the process is killed meanwhile,
    /// [`DatasetFolder::is_begun`] is false already, and the next call removes the rest.
    fn remove_journal(self) -> Result<(), DatasetError> {
        remove(&self.terms_file())?;
        remove(&self.journal())
    }

    /// Removes the journal that a run leaves without terms if it is killed at its very beginning. One with
    /// other files stays.
    fn remove_empty_journal(self) -> Result<(), DatasetError> {
        atomic::sweep_leftovers(&self.journal())?;
        // It may be absent, or hold files of the user.
        let _ = fs::remove_dir(self.journal());
        Ok(())
    }

    /// The folder of the journal, which exists only while a run is unfinished.
    pub(crate) fn journal(self) -> PathBuf {
        self.0.join("journal")
    }

    fn terms_file(self) -> PathBuf {
        self.journal().join("terms.json")
    }

    fn record_file(self, Entry { class, split, name }: &Entry) -> PathBuf {
        self.journal().join("meshes").join(class).join(split.name()).join(format!("{name}.json"))
    }
}

/// The names of the folders that a dataset of `config` may have. All of their files belong to it.
pub(crate) fn folders(config: &DatasetConfig) -> Vec<String> {
    let sets = config.sets.iter().map(|set| set.name.clone());
    sets.chain(["packed", "journal"].map(String::from)).collect()
}

/// The names of the files and folders that a dataset of `config` may have at its top level.
fn top_level(config: &DatasetConfig) -> Vec<String> {
    let mut names = folders(config);
    names.extend(["manifest.json", "failures.jsonl", "example.png"].map(String::from));
    names
}

/// The bytes of `failures.jsonl`, which has a line for each failure.
pub(crate) fn failure_lines(failures: &[MeshFailure]) -> String {
    let line = |failure| {
        let json = serde_json::to_string(failure);
        json.expect("invariant: a `MeshFailure` holds text and numbers") + "\n"
    };
    failures.iter().map(line).collect()
}

/// Removes the file or folder at `path`, if it exists.
pub(crate) fn remove(path: &Path) -> Result<(), DatasetError> {
    let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    match removed {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(DatasetError::io(path, error)),
        _ => Ok(()),
    }
}

pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    let text = fs::read(file).map_err(|error| DatasetError::io(file, error))?;
    serde_json::from_slice(&text).map_err(|error| DatasetError::malformed(file, error))
}

/// Writes a JSON file, whole or not at all.
pub(crate) fn write_json<T: Serialize>(file: &Path, value: &T) -> Result<(), DatasetError> {
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|error| DatasetError::malformed(file, error))?;
    text.push(b'\n');
    Ok(atomic::write_bytes(file, text)?)
}
