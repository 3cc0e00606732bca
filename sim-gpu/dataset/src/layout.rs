//! The paths of the files in a dataset's folder.

use crate::config::{DatasetConfig, Layout, SetConfig, Variant};
use crate::error::DatasetError;
use crate::record::Entry;
use formats::Split;
use formats::scan_file::ScanFormat;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The manifest.
#[must_use]
pub fn manifest(out: &Path) -> PathBuf {
    out.join("manifest.json")
}

/// The list of meshes that could not be scanned. It exists only if there are some.
#[must_use]
pub fn failures(out: &Path) -> PathBuf {
    out.join("failures.jsonl")
}

/// The folder of the journal, which exists only while a run is unfinished.
#[must_use]
pub fn journal(out: &Path) -> PathBuf {
    out.join("journal")
}

/// The example picture.
#[must_use]
pub fn example(out: &Path) -> PathBuf {
    out.join("example.png")
}

/// A file of a scan.
#[must_use]
pub fn scan(
    out: &Path,
    set: &str,
    variant: Variant,
    entry: &Entry,
    view: u32,
    format: ScanFormat,
) -> PathBuf {
    let Entry { class, split, name } = entry;
    let folder = out.join(set).join(variant.name()).join(class).join(split.name());
    folder.join(format!("{name}_v{view}.{format}"))
}

/// The name of a set's variant in packed files, such as `rotational-noisy`.
#[must_use]
pub fn packed_name(set: &SetConfig, variant: Variant) -> String {
    format!("{}-{}", set.name, variant.name())
}

/// The folder of packed files.
#[must_use]
pub fn packed_root(out: &Path) -> PathBuf {
    out.join("packed")
}

/// One packed file.
#[must_use]
pub fn packed(out: &Path, set: &SetConfig, variant: Variant, split: Split) -> PathBuf {
    packed_root(out).join(format!("{}-{}.npz", packed_name(set, variant), split.name()))
}

/// The folder of other projects' layouts.
#[must_use]
pub fn export_root(out: &Path) -> PathBuf {
    out.join("layouts")
}

/// A set's variant in another project's layout.
#[must_use]
pub fn export(out: &Path, layout: Layout, set: &SetConfig, variant: Variant) -> PathBuf {
    export_root(out).join(layout.name()).join(packed_name(set, variant))
}

/// The names of the folders that a dataset of `config` may have. All of their files belong to it.
#[must_use]
pub fn folders(config: &DatasetConfig) -> Vec<String> {
    let mut names: Vec<String> = config.sets.iter().map(|set| set.name.clone()).collect();
    names.extend(["packed", "layouts", "journal"].map(String::from));
    names
}

/// The names of the files and folders that a dataset of `config` may have at its top level.
#[must_use]
pub fn top_level(config: &DatasetConfig) -> Vec<String> {
    let mut names = folders(config);
    names.extend(["manifest.json", "failures.jsonl", "example.png"].map(String::from));
    names
}

/// Removes the file or folder at `path`, if it exists.
pub(crate) fn remove(path: &Path) -> Result<(), DatasetError> {
    let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    match removed {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(DatasetError::io(path, error)),
        _ => Ok(()),
    }
}

/// A relative path with forward slashes, as manifests have it.
#[must_use]
pub fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}
