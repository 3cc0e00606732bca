//! Where everything lies in a dataset's folder.

use super::config::{DatasetConfig, SetConfig, Variant};
use super::record::Entry;
use formats::Split;
use formats::scan_file::ScanFormat;
use std::path::{Path, PathBuf};

/// The manifest.
#[must_use]
pub fn manifest(out: &Path) -> PathBuf {
    out.join("manifest.json")
}

/// The list of meshes that could not be scanned; absent if there are none.
#[must_use]
pub fn failures(out: &Path) -> PathBuf {
    out.join("failures.jsonl")
}

/// The records of an unfinished run; absent once it is finished.
#[must_use]
pub fn journal(out: &Path) -> PathBuf {
    out.join("journal")
}

/// One scan's file.
#[must_use]
pub fn scan(
    out: &Path,
    set: &str,
    variant: Variant,
    entry: &Entry,
    view: u32,
    format: ScanFormat,
) -> PathBuf {
    out.join(set).join(variant.name()).join(&entry.class).join(entry.split.name()).join(format!(
        "{}_v{view}.{}",
        entry.name,
        format.extension()
    ))
}

/// The name of a set's variant in packed files, such as `rotational-noisy`.
#[must_use]
pub fn packed_name(set: &SetConfig, variant: Variant) -> String {
    format!("{}-{}", set.name, variant.name())
}

/// One packed file.
#[must_use]
pub fn packed(out: &Path, set: &SetConfig, variant: Variant, split: Split) -> PathBuf {
    out.join("packed").join(format!("{}-{}.npz", packed_name(set, variant), split.name()))
}

/// The top-level names that a dataset of `config` may hold.
#[must_use]
pub fn top_level(config: &DatasetConfig) -> Vec<String> {
    let mut names: Vec<String> = config.sets.iter().map(|set| set.name.clone()).collect();
    names.extend(
        ["packed", "layouts", "journal", "manifest.json", "failures.jsonl"].map(String::from),
    );
    names
}
