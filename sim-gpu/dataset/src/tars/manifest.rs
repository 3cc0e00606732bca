//! What is known of tars, of parts and of a whole dataset of tars, as files beside them, and whether the
//! tars are as recorded.

use super::Cut;
use crate::config::DatasetConfig;
use crate::error::DatasetError;
use crate::journal::{read_json, write_json};
use crate::layout;
use crate::record::MeshFailure;
use formats::hash::{FileHash, Hashing};
use formats::{Split, atomic};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Digits of a tar's number in its name, so that names are sorted as numbers are.
const DIGITS: usize = 6;

/// As many tars of a split as there are numbers of so many digits.
pub(super) const MOST_TARS: u32 = 10u32.pow(DIGITS as u32);

/// What is known of one tar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TarRecord {
    /// Its name.
    pub file: String,
    /// The hash of its bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// Bytes.
    pub bytes: u64,
    /// Clouds or scans in it.
    pub clouds: u64,
    /// Of meshes that cannot be read or that no view sees well enough, once each.
    pub failures: Vec<MeshFailure>,
    /// Whether it was handed over to a command; if so, it may be gone from here.
    pub handed_over: bool,
    /// A digest of all that decides its bytes.
    pub made_by: String,
}

/// The tars of one part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartManifest {
    /// [`crate::manifest::TOOL`].
    pub tool: String,
    /// Its version.
    pub version: String,
    /// (Number from 0, of how many.)
    pub part: (u32, u32),
    /// What the whole is to hold.
    pub config: DatasetConfig,
    /// How it is cut.
    pub cut: Cut,
    /// All classes of the whole, sorted; labels are places among them.
    pub classes: Vec<String>,
    /// As [`TarRecord::made_by`].
    pub made_by: String,
    /// By split and number.
    pub tars: Vec<TarRecord>,
}

/// All parts of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RootManifest {
    /// [`crate::manifest::TOOL`].
    pub tool: String,
    /// Its version.
    pub version: String,
    /// What it holds.
    pub config: DatasetConfig,
    /// How it is cut.
    pub cut: Cut,
    /// All classes, sorted.
    pub classes: Vec<String>,
    /// By number.
    pub parts: Vec<PartRecord>,
}

/// What is known of one part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartRecord {
    /// The name of its manifest.
    pub file: String,
    /// The hash of that, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// Tars.
    pub tars: u64,
    /// Clouds or scans in them.
    pub clouds: u64,
    /// Bytes of the tars.
    pub bytes: u64,
}

/// The name of the manifest of a part.
#[must_use]
pub fn part_file((number, of): (u32, u32)) -> String {
    format!("part-{number:04}-of-{of:04}.json")
}

/// What tar `number` of `split` and its record are called, but for their extensions.
pub(super) fn tar_stem(split: Split, number: u32) -> String {
    format!("{split}-{number:0DIGITS$}")
}

/// Whether a file of this name is one that part `number` of `of` parts makes: a tar, a record, the
/// manifest of the part, or the list of parts.
#[must_use]
pub fn is_of_part(name: &str, (number, of): (u32, u32)) -> bool {
    let Some((stem, "tar" | "json")) = name.split_once('.') else { return false };
    let digits = Split::ALL.iter().find_map(|split| stem.strip_prefix(&format!("{split}-")));
    let tar = digits.filter(|digits| digits.len() >= DIGITS);
    let tar = tar.filter(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()));
    let tar = tar.and_then(|digits| digits.parse::<u32>().ok());
    tar.is_some_and(|tar| tar % of == number)
        || name == part_file((number, of))
        || name == ROOT_FILE
}

/// The error that what is at `path`, of which the words begin to tell, is of another dataset.
pub(super) fn other_dataset(path: PathBuf, words: &str) -> DatasetError {
    let difference =
        format!("{words}other settings, other meshes, another adapter or another version");
    DatasetError::Different { path, difference }
}

/// Writes `dataset.json` if all parts are there. Two that end at once write the same bytes.
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
        let sum = |of: fn(&TarRecord) -> u64| part.tars.iter().map(of).sum();
        let (clouds, bytes) = (sum(|tar| tar.clouds), sum(|tar| tar.bytes));
        parts.push(PartRecord { file, hash, tars: part.tars.len() as u64, clouds, bytes });
    }
    let PartManifest { tool, version, config, cut, classes, .. } = own.clone();
    let root = RootManifest { tool, version, config, cut, classes, parts };
    write_json(&root_file(out), &root)?;
    // All tasks have ended: what killed ones left is no one's.
    atomic::sweep_leftovers(out)?;
    Ok(())
}

/// The name of the list of parts.
const ROOT_FILE: &str = "dataset.json";

/// Where the list of parts is.
#[must_use]
pub fn root_file(out: &Path) -> PathBuf {
    out.join(ROOT_FILE)
}

/// Whether tars or lists of some parts are in `out`, but not the list of all parts.
#[must_use]
pub fn is_unfinished(out: &Path) -> bool {
    let names = std::fs::read_dir(out).into_iter().flatten().flatten();
    let mut names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let is_part = |name: &str| name.starts_with("part-") && name.ends_with(".json");
    !root_file(out).exists() && names.any(|name| is_part(&name) || is_of_part(&name, (0, 1)))
}

/// Checks the tars of a finished dataset against their records; says what is wrong.
///
/// # Errors
/// If there is no list of parts.
pub fn verify(out: &Path) -> Result<Vec<String>, DatasetError> {
    let root: RootManifest = read_json(&root_file(out))?;
    let mut problems = Vec::new();
    for PartRecord { file, hash, .. } in &root.parts {
        let path = out.join(file);
        check(&path, root.config.hash, hash.as_ref(), None, &mut problems);
        match read_json::<PartManifest>(&path) {
            Ok(part) => {
                for TarRecord { file, hash, bytes, .. } in &part.tars {
                    let path = out.join(file);
                    check(&path, root.config.hash, hash.as_ref(), Some(*bytes), &mut problems);
                }
            }
            Err(error) => problems.push(error.to_string()),
        }
    }
    Ok(problems)
}

fn check(
    path: &Path,
    hashing: Hashing,
    hash: Option<&FileHash>,
    bytes: Option<u64>,
    problems: &mut Vec<String>,
) {
    let size = match std::fs::metadata(path) {
        Ok(file) => file.len(),
        Err(error) => return problems.push(DatasetError::io(path, error).to_string()),
    };
    match hashing.of_file(path) {
        Ok(found) if found.as_ref() == hash && bytes.is_none_or(|bytes| bytes == size) => {}
        Ok(_) => problems.push(format!("{}: is not as recorded", layout::slashed(path))),
        Err(error) => problems.push(error.to_string()),
    }
}
