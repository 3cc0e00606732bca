//! What a finished dataset is published with: a card for people, `README.md` as Hugging Face shows it,
//! and metadata for programs, `croissant.json`.

mod card;
mod croissant;

use super::config::DatasetConfig;
use super::error::DatasetError;
use super::journal::{read_json, write_json};
use super::layout;
use super::manifest::Manifest;
use super::tars::{Cut, PartManifest, RootManifest, Sample, is_unfinished, root_file};
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
    manifest: (&'static str, String),
}

/// How a dataset is kept.
enum Form {
    /// A file for each scan, and packed clouds: by packed file, how many.
    Files { scans: u64, packed: Vec<(String, u64)> },
    /// Tars: of each split how many tars, and how many clouds or scans.
    Tars { cut: Cut, splits: Vec<(Split, u64, u64)> },
}

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
    let files = ["README.md", "croissant.json"].map(|name| out.join(name));
    if let Some(path) = files.iter().find(|path| !replace && path.exists()) {
        return Err(DatasetError::Published { path: path.clone() });
    }
    atomic::write_bytes(&files[0], card::card(publication, &facts))?;
    write_json(&files[1], &croissant::metadata(publication, &facts))?;
    Ok(files)
}

impl Facts {
    fn of(out: &Path) -> Result<Self, DatasetError> {
        let is_of_tars = root_file(out).exists();
        let path = if is_of_tars { root_file(out) } else { layout::manifest(out) };
        if layout::journal(out).exists() || is_unfinished(out) {
            return Err(DatasetError::Unfinished { path: out.into() });
        }
        let (version, config, classes, form) = if is_of_tars {
            let root: RootManifest = read_json(&path)?;
            let form = Form::Tars { cut: root.cut, splits: splits(out, &root)? };
            (root.version, root.config, root.classes, form)
        } else {
            let manifest = Manifest::read(&path)?;
            if let Some((number, of)) = manifest.shard {
                let cause =
                    format!("expected a whole dataset, found part {number} of {of}; merge them");
                return Err(DatasetError::Shard { path: out.into(), cause });
            }
            let classes = manifest.classes();
            let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
            let scans = scans.map(|scan| scan.variants.len() as u64).sum();
            let packed = manifest.packed.into_iter().map(|file| (file.file, file.clouds));
            let form = Form::Files { scans, packed: packed.collect() };
            (manifest.version, manifest.config, classes, form)
        };
        let name = if is_of_tars { "dataset.json" } else { "manifest.json" };
        let hash = Hashing::Sha256.of_file(&path)?;
        let digits = hash.map(|hash| hash.digits().to_owned()).unwrap_or_default();
        Ok(Self { version, config, classes, form, manifest: (name, digits) })
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

/// The splits that have tars, each with how many it has and how many clouds or scans they hold.
fn splits(out: &Path, root: &RootManifest) -> Result<Vec<(Split, u64, u64)>, DatasetError> {
    let mut tars = Vec::new();
    for part in &root.parts {
        tars.extend(read_json::<PartManifest>(&out.join(&part.file))?.tars);
    }
    let of = |split: Split| {
        let own = tars.iter().filter(|tar| tar.file.starts_with(split.name()));
        let (tars, samples) = own.fold((0, 0), |(n, sum), tar| (n + 1, sum + tar.clouds));
        (split, tars, samples)
    };
    Ok(Split::ALL.map(of).into_iter().filter(|(_, tars, _)| *tars > 0).collect())
}
