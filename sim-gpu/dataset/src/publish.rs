//! The card of a finished dataset for people, `README.md` as Hugging Face shows it, and its metadata
//! for programs, `croissant.json`.

mod card;
mod croissant;

use crate::config::DatasetConfig;
use crate::error::DatasetError;
use crate::journal::{read_json, write_json};
use crate::layout;
use crate::manifest::Manifest;
use crate::retract::FILES;
use crate::tars::{Cut, PartManifest, PartRecord, RootManifest, Sample, root_file};
use crate::verify::is_unfinished;
use formats::hash::Hashing;
use formats::{Split, atomic};
use std::path::{Path, PathBuf};

/// The facts about a dataset that only its publisher knows.
#[derive(Clone, Debug, Default)]
pub struct Publication {
    /// Its name.
    pub name: String,
    /// Its licence, as an identifier of SPDX.
    pub license: Option<String>,
    /// Its address.
    pub url: Option<String>,
    /// Who made it.
    pub creator: Option<String>,
    /// The day of its publication, as `2026-11-25`.
    pub published: Option<String>,
}

/// The facts about a dataset in its manifest.
struct Facts {
    /// The version of Edgepuck that made it.
    version: String,
    config: DatasetConfig,
    /// A label is an index into them.
    classes: Vec<String>,
    form: Form,
    /// The manifest's name, and its SHA-256 in hexadecimal digits.
    manifest: (String, String),
}

/// The files of a dataset.
enum Form {
    /// A file for each scan, and packed files with their numbers of clouds.
    Files { scans: u64, packed: Vec<(String, u64)> },
    /// Tars: by split, the number of tars and of clouds or scans.
    Tars { cut: Cut, splits: Vec<(Split, u64, u64)> },
}

/// Writes the card and the metadata of the finished dataset in `out`, and returns their paths.
///
/// # Errors
/// A dataset that is not finished, or is one part of several; a card or metadata that exist already,
/// unless `replace`; a file that cannot be read or written.
pub fn publish(
    out: &Path,
    publication: &Publication,
    replace: bool,
) -> Result<[PathBuf; 2], DatasetError> {
    let facts = Facts::read(out)?;
    let files = FILES.map(|name| out.join(name));
    if let Some(path) = files.iter().find(|path| !replace && path.exists()) {
        let cause = "exists already; replace it with --overwrite";
        return Err(DatasetError::malformed(path, cause));
    }
    let (card, metadata) =
        (card::card(publication, &facts), croissant::metadata(publication, &facts));
    write_json(&files[1], &metadata)?;
    atomic::write_bytes(&files[0], card)?;
    Ok(files)
}

impl Facts {
    fn read(out: &Path) -> Result<Self, DatasetError> {
        if is_unfinished(out) {
            return Err(DatasetError::Unfinished { path: out.into() });
        }
        if root_file(out).exists() { Self::from_tars(out) } else { Self::from_files(out) }
    }

    fn from_tars(out: &Path) -> Result<Self, DatasetError> {
        let path = root_file(out);
        let RootManifest { version, config, cut, classes, parts, .. } = read_json(&path)?;
        let form = Form::Tars { cut, splits: splits(out, &parts)? };
        Ok(Self { version, config, classes, form, manifest: named_hash(&path)? })
    }

    fn from_files(out: &Path) -> Result<Self, DatasetError> {
        let path = layout::manifest(out);
        let manifest = Manifest::read(&path)?;
        if let Some((number, of)) = manifest.shard {
            let part = number + 1;
            let cause = format!("expected a whole dataset, found part {part} of {of}; merge them");
            return Err(DatasetError::malformed(out, cause));
        }
        let classes = manifest.classes();
        let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
        let scans = scans.map(|scan| scan.variants.len() as u64).sum();
        let packed = manifest.packed.into_iter().map(|file| (file.file, file.clouds)).collect();
        let form = Form::Files { scans, packed };
        let (version, config) = (manifest.version, manifest.config);
        Ok(Self { version, config, classes, form, manifest: named_hash(&path)? })
    }

    /// The number of clouds or scans.
    fn count(&self) -> u64 {
        match &self.form {
            Form::Files { scans, .. } => *scans,
            Form::Tars { splits, .. } => splits.iter().map(|(_, _, samples)| samples).sum(),
        }
    }

    /// The noun for what [`Facts::count`] counts.
    fn noun(&self) -> &'static str {
        match self.form {
            Form::Tars { cut: Cut { sample: Sample::Clouds, .. }, .. } => "point clouds",
            Form::Tars { .. } | Form::Files { .. } => "scans",
        }
    }
}

fn named_hash(path: &Path) -> Result<(String, String), DatasetError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let hash = Hashing::Sha256.of_file(path)?.expect("invariant: SHA-256 was asked for");
    Ok((name, hash.digits().to_owned()))
}

/// The splits that have tars, with their numbers of tars and of clouds or scans.
fn splits(out: &Path, parts: &[PartRecord]) -> Result<Vec<(Split, u64, u64)>, DatasetError> {
    let mut tars = Vec::new();
    for part in parts {
        tars.extend(read_json::<PartManifest>(&out.join(&part.file))?.tars);
    }
    let count = |split: Split| {
        let own = tars.iter().filter(|tar| tar.file.starts_with(split.name()));
        let (tars, samples) = own.fold((0, 0), |(n, sum), tar| (n + 1, sum + tar.clouds));
        (split, tars, samples)
    };
    Ok(Split::ALL.map(count).into_iter().filter(|(_, tars, _)| *tars > 0).collect())
}
