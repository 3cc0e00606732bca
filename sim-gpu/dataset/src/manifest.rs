//! The manifest: everything that a dataset is made of and was made by.
//!
//! It holds nothing of time, speed or threads, so that the same run gives the
//! same bytes.

use super::config::{DatasetConfig, SetConfig, Viewpoints};
use super::error::DatasetError;
use super::journal::{Terms, digest, read_json, write_json};
use super::layout;
use super::record::{Entry, FileRecord, MeshFailure, MeshRecord, VariantRecord};
use formats::hash::{FileHash, Hashing};
use serde::{Deserialize, Serialize};
use sim_gpu::internals::pose::Pose;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// What made the dataset; the manifest of anything else is refused.
pub const TOOL: &str = "edgepuck";

/// A finished dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`TOOL`].
    pub tool: String,
    /// Its version.
    pub version: String,
    /// What cast the rays: each adapter once, sorted.
    pub adapters: Vec<String>,
    /// Which part of the meshes: (number from 0, of how many).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<(u32, u32)>,
    /// What it was to hold.
    pub config: DatasetConfig,
    /// Where the sensors stood, by set in the order of the configuration.
    pub poses: Vec<SetPoses>,
    /// The packed files: by set, variant and split.
    pub packed: Vec<PackedRecord>,
    /// The files of other projects' layouts, sorted.
    pub layout_files: Vec<LayoutFile>,
    /// Meshes that could not be scanned, sorted by entry.
    pub failures: Vec<MeshFailure>,
    /// Meshes that were scanned, sorted by entry.
    pub meshes: Vec<MeshRecord>,
}

/// Where one set's sensor stood.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetPoses {
    /// The set.
    pub set: String,
    /// By view.
    #[serde(flatten)]
    pub poses: Poses,
}

/// Poses by view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Poses {
    /// The same around every mesh.
    EveryMesh(Vec<Pose>),
    /// Each mesh has its own, since views are drawn. Sorted.
    EachMesh(Vec<MeshPoses>),
}

/// The poses around one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshPoses {
    /// [`Entry::id`]; meshes of one id in both splits share their poses.
    pub id: String,
    /// By view.
    pub poses: Vec<Pose>,
}

/// One packed file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackedRecord {
    /// Its path from the dataset's folder, with forward slashes.
    pub file: String,
    /// The hash of its bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// Clouds in it.
    pub clouds: u64,
    /// The scans that are not in it: they have fewer points than
    /// [`DatasetConfig::min_points`], or none.
    pub left_out: Vec<LeftOut>,
}

/// A scan that is not packed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// `CLASS/NAME_vK`.
    pub name: String,
    /// How many points it has.
    pub points: u64,
}

/// A file of another project's layout.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LayoutFile {
    /// Its path from the dataset's folder, with forward slashes.
    pub file: String,
    /// The hash of its bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
}

impl Manifest {
    /// Reads the manifest `file`.
    ///
    /// # Errors
    /// [`DatasetError::NoManifest`] if there is none; a manifest that cannot be
    /// read, is not ours, or holds a name that would lead out of the folder.
    pub fn read(file: &Path) -> Result<Self, DatasetError> {
        if !file.exists() {
            return Err(DatasetError::NoManifest { path: file.into() });
        }
        let manifest: Self = read_json(file)?;
        match manifest.flaw() {
            None => Ok(manifest),
            Some(cause) => Err(DatasetError::Malformed { path: file.into(), cause }),
        }
    }

    /// Writes it to `file`, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), DatasetError> {
        write_json(file, self)
    }

    /// The terms of the run that made the dataset.
    #[must_use]
    pub fn terms(&self) -> Terms {
        Terms {
            version: self.version.clone(),
            config: self.config.clone(),
            adapter: self.adapters.join(", "),
            meshes: digest(self.sources()),
            shard: self.shard,
        }
    }

    /// All classes, sorted: a label is an index into them. Those of meshes that
    /// could not be scanned count, so that labels do not hang on failures.
    #[must_use]
    pub fn classes(&self) -> Vec<String> {
        let classes: BTreeSet<&str> = self.entries().map(|entry| entry.class.as_str()).collect();
        classes.into_iter().map(str::to_owned).collect()
    }

    /// The entries of all meshes: those scanned, then those that failed.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        let failed = self.failures.iter().map(|failure| &failure.entry);
        self.meshes.iter().map(|record| &record.entry).chain(failed)
    }

    /// The files of all scans: the path from the dataset's folder, what is recorded of
    /// the file, and of its scan.
    pub(super) fn scan_files(
        &self,
    ) -> impl Iterator<Item = (PathBuf, &FileRecord, &VariantRecord)> {
        let scans = self.meshes.iter().flat_map(|mesh| mesh.scans.iter().map(move |s| (mesh, s)));
        let variants = scans.flat_map(|(mesh, scan)| {
            scan.variants.iter().map(move |written| (&mesh.entry, scan, written))
        });
        variants.flat_map(|(entry, scan, written)| {
            written.files.iter().map(move |file| {
                let (root, variant) = (Path::new(""), written.variant);
                let path = layout::scan(root, &scan.set, variant, entry, scan.view, file.format);
                (path, file, written)
            })
        })
    }

    /// The hashes of all meshes and files.
    fn hashes(&self) -> impl Iterator<Item = &Option<FileHash>> {
        let meshes = self.meshes.iter().map(|mesh| &mesh.hash);
        let scans = self.scan_files().map(|(_, file, _)| &file.hash);
        let packed = self.packed.iter().map(|packed| &packed.hash);
        meshes.chain(scans).chain(packed).chain(self.layout_files.iter().map(|file| &file.hash))
    }

    /// Every mesh and its file, scanned or failed.
    fn sources(&self) -> impl Iterator<Item = (Entry, &str)> {
        let failed = self.failures.iter().map(|f| (f.entry.clone(), f.source.as_str()));
        self.meshes.iter().map(|m| (m.entry.clone(), m.source.as_str())).chain(failed)
    }

    fn flaw(&self) -> Option<String> {
        if self.tool != TOOL {
            return Some(format!("made by `{}`, not by `{TOOL}`", self.tool));
        }
        if let Some((number, of)) = self.shard.filter(|(number, of)| number >= of) {
            return Some(format!("part {number} from 0 of {of} parts"));
        }
        let hashing =
            |hash: &Option<FileHash>| hash.as_ref().map_or(Hashing::None, FileHash::hashing);
        if let Some(other) = self.hashes().map(hashing).find(|found| *found != self.config.hash) {
            let expected = self.config.hash;
            return Some(format!("expected the hash {expected} of every file, found {other}"));
        }
        let folders = self.config.sets.iter().map(|set| &set.name);
        let names = self.entries().flat_map(|entry| [&entry.class, &entry.name]);
        folders
            .chain(names)
            .find(|name| !is_plain(name))
            .map(|name| format!("expected the name of a file or folder, found `{name}`"))
    }
}

/// Whether `name` leads to a file of that name in the folder it is joined to.
pub(super) fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.contains(['/', '\\'])
        && matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None))
}

/// The poses of all sets around the meshes of `records`.
pub(super) fn poses(config: &DatasetConfig, records: &[MeshRecord]) -> Vec<SetPoses> {
    let of = |set: &SetConfig| SetPoses {
        set: set.name.clone(),
        poses: set_poses(config, set, records),
    };
    config.sets.iter().map(of).collect()
}

fn set_poses(config: &DatasetConfig, set: &SetConfig, records: &[MeshRecord]) -> Poses {
    let drawn = matches!(&set.viewpoints, Viewpoints::Views(views) if !views.is_regular());
    if !drawn {
        return Poses::EveryMesh(set.poses(config.seed, ""));
    }
    let ids: BTreeSet<String> = records.iter().map(|record| record.entry.id()).collect();
    let of = |id: String| MeshPoses { poses: set.poses(config.seed, &id), id };
    Poses::EachMesh(ids.into_iter().map(of).collect())
}
