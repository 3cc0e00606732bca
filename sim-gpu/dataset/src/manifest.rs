//! The manifest of a dataset: its settings, its files, and what made it.
//!
//! It has no times, speeds or numbers of threads, so that the same run gives the same bytes.

use crate::config::{DatasetConfig, SetConfig, Viewpoints};
use crate::plan::{Terms, digest};
use crate::record::{Entry, FileRecord, MeshFailure, MeshRecord, VariantRecord};
use edgepuck_mesh::frame::Normalize;
use formats::hash::{FileHash, Hashing};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use sim_gpu::Pose;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// The tool that made the dataset; manifests of other tools are refused.
pub const TOOL: &str = "edgepuck";

/// A finished dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// `edgepuck`.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// The adapters that cast the rays, once each, sorted.
    pub adapters: Vec<String>,
    /// The part of the meshes: (number from 0, number of parts).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<(u32, u32)>,
    /// The settings of the dataset.
    pub config: DatasetConfig,
    /// The poses of the sensors, by set in the order of the configuration.
    pub poses: Vec<SetPoses>,
    /// The packed files: by set, variant and split.
    pub packed: Vec<PackedRecord>,
    /// Always empty; manifests keep their form.
    pub layout_files: [(); 0],
    /// Meshes that could not be scanned, sorted by entry.
    pub failures: Vec<MeshFailure>,
    /// Meshes that were scanned, sorted by entry.
    pub meshes: Vec<MeshRecord>,
}

/// The poses of one set's sensor.
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
    /// The same poses around every mesh.
    EveryMesh(Vec<Pose>),
    /// Each mesh has its own poses, since views are drawn at random or meshes stay where they are;
    /// sorted.
    EachMesh(Vec<MeshPoses>),
}

/// The poses around one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshPoses {
    /// [`Entry::id`]; meshes of one id in both splits share poses that are around the origin.
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
    /// Number of clouds in it.
    pub clouds: u64,
    /// The scans that are left out because they have no points or fewer than
    /// [`DatasetConfig::min_points`].
    pub left_out: Vec<LeftOut>,
}

/// A scan that is not packed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// `CLASS/NAME_vK`.
    pub name: String,
    /// Its number of points.
    pub points: u64,
}

impl Manifest {
    /// The conditions of the run that made the dataset.
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

    /// All classes, sorted: a label is an index into them. They include those of meshes that could
    /// not be scanned, so that labels do not depend on failures.
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

    /// The files of all scans: the path from the dataset's folder, the record of the file, and
    /// that of its scan.
    pub(crate) fn scan_files(
        &self,
    ) -> impl Iterator<Item = (PathBuf, &FileRecord, &VariantRecord)> {
        let scans = self.meshes.iter().flat_map(|mesh| mesh.scans.iter().map(move |s| (mesh, s)));
        let variants = scans.flat_map(|(mesh, scan)| {
            scan.variants.iter().map(move |written| (&mesh.entry, scan, written))
        });
        variants.flat_map(|(entry, scan, written)| {
            written.files.iter().map(move |file| {
                let path = entry.scan_file(&scan.set, written.variant, scan.view, file.format);
                (path, file, written)
            })
        })
    }

    fn hashes(&self) -> impl Iterator<Item = &Option<FileHash>> {
        let meshes = self.meshes.iter().map(|mesh| &mesh.hash);
        let scans = self.scan_files().map(|(_, file, _)| &file.hash);
        let packed = self.packed.iter().map(|packed| &packed.hash);
        meshes.chain(scans).chain(packed)
    }

    /// Every mesh and its file, scanned or failed.
    fn sources(&self) -> impl Iterator<Item = (Entry, &str)> {
        let failed = self.failures.iter().map(|f| (f.entry.clone(), f.source.as_str()));
        self.meshes.iter().map(|m| (m.entry.clone(), m.source.as_str())).chain(failed)
    }

    /// What makes it no manifest of this tool, or unsafe to follow.
    pub(crate) fn flaw(&self) -> Option<String> {
        if self.tool != TOOL {
            return Some(format!("expected a dataset of `{TOOL}`, found one of `{}`", self.tool));
        }
        if let Some((number, of)) = self.shard.filter(|(number, of)| number >= of) {
            return Some(format!("expected a part below {of}, found {number}"));
        }
        let hashing = |hash: &Option<FileHash>| match hash {
            Some(_) => Hashing::Sha256,
            None => Hashing::None,
        };
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

/// Whether `name`, joined to a folder, is a file in that folder.
pub(crate) fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.contains(['/', '\\'])
        && matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None))
}

/// The poses of all sets around the meshes of `records`.
pub(crate) fn poses(config: &DatasetConfig, records: &[MeshRecord]) -> Vec<SetPoses> {
    let poses = |set: &SetConfig| SetPoses {
        set: set.name.clone(),
        poses: set_poses(config, set, records),
    };
    config.sets.iter().map(poses).collect()
}

fn set_poses(config: &DatasetConfig, set: &SetConfig, records: &[MeshRecord]) -> Poses {
    let drawn = matches!(&set.viewpoints, Viewpoints::Views(views) if !views.is_regular());
    let moved =
        matches!(set.viewpoints, Viewpoints::Views(_)) && config.normalize == Normalize::None;
    if !drawn && !moved {
        return Poses::EveryMesh(set.poses(config.seed, "", DVec3::ZERO));
    }
    let poses = |record: &MeshRecord| {
        let id = record.entry.id();
        let around = DVec3::from_array(record.views_around);
        MeshPoses { poses: set.poses(config.seed, &id, around), id }
    };
    let mut each: Vec<MeshPoses> = records.iter().map(poses).collect();
    each.sort_by(|p, q| p.id.cmp(&q.id));
    each.dedup();
    Poses::EachMesh(each)
}
