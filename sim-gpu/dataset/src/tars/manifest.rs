//! The records of tars, of parts and of a whole dataset of tars, which are files beside the tars.

use super::Cut;
use crate::config::DatasetConfig;
use crate::error::DatasetError;
use crate::folder::{read_json, write_json};
use crate::record::MeshFailure;
use formats::hash::FileHash;
use formats::{Split, atomic};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Digits of a tar's number in its name, so that the order of names is that of numbers.
const DIGITS: usize = 6;

/// Most tars of a split: there are no more numbers of [`DIGITS`] digits.
pub(super) const MOST_TARS: u32 = 10u32.pow(DIGITS as u32);

/// The record of one tar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TarRecord {
    /// Its name.
    pub file: String,
    /// The hash of its bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// Its size, bytes.
    pub bytes: u64,
    /// Number of clouds or scans in it.
    pub clouds: u64,
    /// Meshes that cannot be read or that have too few points in all views, once each.
    pub failures: Vec<MeshFailure>,
    /// Whether it was handed over; if so, it may be gone from the folder.
    pub handed_over: bool,
    /// A digest of everything that decides its bytes.
    pub made_by: String,
}

/// The tars of one part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartManifest {
    /// `edgepuck`.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// (Number from 0, number of parts.)
    pub part: (u32, u32),
    /// The settings of the whole dataset.
    pub config: DatasetConfig,
    /// How the dataset is cut into tars.
    pub cut: Cut,
    /// All classes of the dataset, sorted; a label is an index into them.
    pub classes: Vec<String>,
    /// The same as [`TarRecord::made_by`].
    pub made_by: String,
    /// Its tars, by split and number.
    pub tars: Vec<TarRecord>,
}

/// The parts of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RootManifest {
    /// `edgepuck`.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// The settings of the dataset.
    pub config: DatasetConfig,
    /// How the dataset is cut into tars.
    pub cut: Cut,
    /// All classes, sorted.
    pub classes: Vec<String>,
    /// The parts, by number.
    pub parts: Vec<PartRecord>,
}

/// The record of one part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartRecord {
    /// The name of its manifest.
    pub file: String,
    /// The hash of its manifest, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// Number of tars.
    pub tars: u64,
    /// Number of clouds or scans in them.
    pub clouds: u64,
    /// Size of the tars, bytes.
    pub bytes: u64,
}

/// The name of the manifest of a part.
pub(super) fn part_file((number, of): (u32, u32)) -> String {
    format!("part-{number:04}-of-{of:04}.json")
}

/// The name of tar `number` of `split`, and of its record, without the extension.
pub(super) fn tar_stem(split: Split, number: u32) -> String {
    format!("{split}-{number:0DIGITS$}")
}

/// Whether part `number` of `of` parts makes a file of this name: a tar, a record, the manifest of
/// the part, or the list of parts.
pub(super) fn is_of_part(name: &str, (number, of): (u32, u32)) -> bool {
    let Some((stem, "tar" | "json")) = name.split_once('.') else { return false };
    let digits = Split::ALL.iter().find_map(|split| stem.strip_prefix(&format!("{split}-")));
    let tar = digits.filter(|digits| digits.len() >= DIGITS);
    let tar = tar.filter(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()));
    let tar = tar.and_then(|digits| digits.parse::<u32>().ok());
    tar.is_some_and(|tar| tar % of == number)
        || name == part_file((number, of))
        || name == ROOT_FILE
}

/// The error that the file at `path` belongs to another dataset; `words` begin its cause.
pub(super) fn other_dataset(path: PathBuf, words: &str) -> DatasetError {
    let difference =
        format!("{words}other settings, other meshes, another adapter or another version");
    DatasetError::Different { path, difference }
}

/// Writes `dataset.json` if all parts exist. Two parts that end at once write the same bytes.
pub(super) fn write_root(out: &Path, own: &PartManifest) -> Result<(), DatasetError> {
    let mut parts = Vec::new();
    for number in 0..own.part.1 {
        let file = part_file((number, own.part.1));
        let path = out.join(&file);
        if !path.exists() {
            return Ok(());
        }
        let part: PartManifest = read_json(&path)?;
        if part.made_by != own.made_by {
            return Err(other_dataset(path, "this part has "));
        }
        let hash = own.config.hash.of_file(&path)?;
        let sum = |count: fn(&TarRecord) -> u64| part.tars.iter().map(count).sum();
        let (clouds, bytes) = (sum(|tar| tar.clouds), sum(|tar| tar.bytes));
        parts.push(PartRecord { file, hash, tars: part.tars.len() as u64, clouds, bytes });
    }
    let PartManifest { tool, version, config, cut, classes, .. } = own.clone();
    let root = RootManifest { tool, version, config, cut, classes, parts };
    write_json(&root_file(out), &root)?;
    // All parts have ended, so that no temporary file is in use.
    atomic::sweep_leftovers(out)?;
    Ok(())
}

const ROOT_FILE: &str = "dataset.json";

/// The path of the list of parts.
pub(crate) fn root_file(out: &Path) -> PathBuf {
    out.join(ROOT_FILE)
}

/// Whether `out` holds tars or manifests of some parts, but not the list of all parts.
pub(crate) fn is_unfinished(out: &Path) -> bool {
    let names = std::fs::read_dir(out).into_iter().flatten().flatten();
    let mut names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let is_part = |name: &str| name.starts_with("part-") && name.ends_with(".json");
    !root_file(out).exists() && names.any(|name| is_part(&name) || is_of_part(&name, (0, 1)))
}
