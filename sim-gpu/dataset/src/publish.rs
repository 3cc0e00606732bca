//! What a finished dataset is published with: a card for people, `README.md` as Hugging Face shows it,
//! and metadata for programs, `croissant.json`.

mod card;
mod croissant;

use super::config::DatasetConfig;
use super::error::DatasetError;
use super::journal::{read_json, write_json};
use super::layout;
use super::manifest::Manifest;
use super::tars::{Cut, PartManifest, PartRecord, RootManifest, Sample, root_file};
use super::verify::is_unfinished;
use formats::hash::Hashing;
use formats::{Split, atomic};
use std::path::{Path, PathBuf};

/// What nobody but its publisher knows of a dataset.
#[derive(Clone, Debug, Default)]
pub struct Publication {
    /// Its name.
    pub name: String,
    /// Its licence, as an identifier of SPDX.
    pub license: Option<String>,
    /// Where it is to be found.
    pub url: Option<String>,
    /// Who made it.
    pub creator: Option<String>,
    /// The day of its publication, as `2026-11-25`.
    pub published: Option<String>,
}

/// What its manifest says of a dataset.
struct Facts {
    /// The version of Edgepuck that made it.
    version: String,
    config: DatasetConfig,
    /// A label is a place among them.
    classes: Vec<String>,
    form: Form,
    /// The manifest's name and, in hexadecimal digits, its SHA-256.
    manifest: (String, String),
}

/// How a dataset is kept.
enum Form {
    /// A file for each scan, and packed clouds: by packed file, how many.
    Files { scans: u64, packed: Vec<(String, u64)> },
    /// Tars: of each split how many tars, and how many clouds or scans.
    Tars { cut: Cut, splits: Vec<(Split, u64, u64)> },
}

/// The card and the metadata.
const FILES: [&str; 2] = ["README.md", "croissant.json"];

/// Writes the card and the metadata of the finished dataset in `out`, and returns where they are.
///
/// # Errors
/// No finished dataset, or one part of several; [`DatasetError::Published`] if there is a card or
/// metadata already, unless `replace`; a file that cannot be read or written.
pub fn publish(
    out: &Path,
    publication: &Publication,
    replace: bool,
) -> Result<[PathBuf; 2], DatasetError> {
    let facts = Facts::of(out)?;
    let files = FILES.map(|name| out.join(name));
    if let Some(path) = files.iter().find(|path| !replace && path.exists()) {
        return Err(DatasetError::Published { path: path.clone() });
    }
    let (card, metadata) =
        (card::card(publication, &facts), croissant::metadata(publication, &facts));
    write_json(&files[1], &metadata)?;
    atomic::write_bytes(&files[0], card)?;
    Ok(files)
}

/// Removes what [`publish`] wrote into `out`, which is not true of what replaces the dataset there. A
/// `README.md` that it did not write stays.
///
/// # Errors
/// A file that cannot be read or removed.
pub fn retract(out: &Path) -> Result<(), DatasetError> {
    let [card, metadata] = FILES.map(|name| out.join(name));
    if !metadata.exists() {
        return Ok(());
    }
    layout::remove(&metadata)?;
    match std::fs::read_to_string(&card) {
        Ok(text) if text.ends_with(card::CLOSE) => layout::remove(&card),
        _ => Ok(()),
    }
}

impl Facts {
    fn of(out: &Path) -> Result<Self, DatasetError> {
        if is_unfinished(out) {
            return Err(DatasetError::Unfinished { path: out.into() });
        }
        if root_file(out).exists() { Self::of_tars(out) } else { Self::of_files(out) }
    }

    fn of_tars(out: &Path) -> Result<Self, DatasetError> {
        let path = root_file(out);
        let RootManifest { version, config, cut, classes, parts, .. } = read_json(&path)?;
        let form = Form::Tars { cut, splits: splits(out, &parts)? };
        Ok(Self { version, config, classes, form, manifest: named_hash(&path)? })
    }

    fn of_files(out: &Path) -> Result<Self, DatasetError> {
        let path = layout::manifest(out);
        let manifest = Manifest::read(&path)?;
        if let Some((number, of)) = manifest.shard {
            let part = number + 1;
            let cause = format!("expected a whole dataset, found part {part} of {of}; merge them");
            return Err(DatasetError::Shard { path: out.into(), cause });
        }
        let classes = manifest.classes();
        let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
        let scans = scans.map(|scan| scan.variants.len() as u64).sum();
        let packed = manifest.packed.into_iter().map(|file| (file.file, file.clouds)).collect();
        let form = Form::Files { scans, packed };
        let (version, config) = (manifest.version, manifest.config);
        Ok(Self { version, config, classes, form, manifest: named_hash(&path)? })
    }

    /// How many clouds, or scans, there are in all.
    fn count(&self) -> u64 {
        match &self.form {
            Form::Files { scans, .. } => *scans,
            Form::Tars { splits, .. } => splits.iter().map(|(_, _, samples)| samples).sum(),
        }
    }

    /// What is counted.
    fn noun(&self) -> &'static str {
        match self.form {
            Form::Tars { cut: Cut { sample: Sample::Clouds, .. }, .. } => "point clouds",
            Form::Tars { .. } | Form::Files { .. } => "scans",
        }
    }
}

/// A file's name and its SHA-256.
fn named_hash(path: &Path) -> Result<(String, String), DatasetError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let hash = Hashing::Sha256.of_file(path)?.expect("invariant: SHA-256 was asked for");
    Ok((name, hash.digits().to_owned()))
}

/// The splits that have tars, each with how many it has and how many clouds or scans they hold.
fn splits(out: &Path, parts: &[PartRecord]) -> Result<Vec<(Split, u64, u64)>, DatasetError> {
    let mut tars = Vec::new();
    for part in parts {
        tars.extend(read_json::<PartManifest>(&out.join(&part.file))?.tars);
    }
    let of = |split: Split| {
        let own = tars.iter().filter(|tar| tar.file.starts_with(split.name()));
        let (tars, samples) = own.fold((0, 0), |(n, sum), tar| (n + 1, sum + tar.clouds));
        (split, tars, samples)
    };
    Ok(Split::ALL.map(of).into_iter().filter(|(_, tars, _)| *tars > 0).collect())
}
