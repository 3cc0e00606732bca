//! What is known of each mesh once its scans are written.

use super::config::Variant;
use formats::Split;
use formats::hash::FileHash;
use formats::scan_file::ScanFormat;
use serde::{Deserialize, Serialize};
use sim_gpu::internals::mesh::frame::Up;
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::mesh::validate::MeshDefects;
use sim_gpu::internals::scan::Tally;
use sim_gpu::internals::simplify::Simplified;
use std::fmt;

/// Which mesh of a dataset: orders everything that is listed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Entry {
    /// Its class.
    pub class: String,
    /// Its split.
    pub split: Split,
    /// Its name, unique in class and split.
    pub name: String,
}

/// One mesh that was scanned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshRecord {
    /// Which.
    #[serde(flatten)]
    pub entry: Entry,
    /// The file, from the dataset's folder, with forward slashes.
    pub source: String,
    /// The hash of the file's bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// The axis that was taken for upward.
    pub up: Up,
    /// What was subtracted from the upright vertices.
    pub centre: [f64; 3],
    /// What they were then multiplied by.
    pub scale: f64,
    /// Triangles in the file, polygons cut up.
    pub triangles: u64,
    /// Faces of fewer than three corners.
    pub dropped_faces: u64,
    /// What was found among the triangles and vertices.
    #[serde(flatten)]
    pub defects: MeshDefects,
    /// What simplification made of it, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simplified: Option<Simplified>,
    /// Its scans: by set in the order of the configuration, then by view.
    pub scans: Vec<ScanRecord>,
}

/// One view of one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScanRecord {
    /// The set.
    pub set: String,
    /// The view's number.
    pub view: u32,
    /// What was written, in the configuration's order of variants.
    pub variants: Vec<VariantRecord>,
}

/// One scan as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VariantRecord {
    /// Which effects.
    pub variant: Variant,
    /// What became of the returns.
    #[serde(flatten)]
    pub tally: Tally,
    /// The files, in the configuration's order of formats.
    pub files: Vec<FileRecord>,
    /// Its cloud, from when it was written to when it is packed. Files of records lack
    /// it, and so do scans beyond the memory for clouds, which are read again.
    #[serde(skip)]
    pub cloud: Option<Cloud>,
}

/// A scan at the size and scale of packed clouds.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// As many points as [`DatasetConfig`](super::config::DatasetConfig) says, mean 0 and
    /// largest radius 1.
    pub points: Vec<[f32; 3]>,
    /// The surface's normal at each point, if a layout asks for normals and the scan
    /// has them.
    pub normals: Option<Vec<[f32; 3]>>,
}

/// One file as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Its format.
    pub format: ScanFormat,
    /// The hash of its bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
}

/// One mesh that could not be scanned.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFailure {
    /// Which.
    #[serde(flatten)]
    pub entry: Entry,
    /// The file, from the dataset's folder.
    pub source: String,
    /// The line where it went wrong, if the file has lines.
    pub line: Option<u64>,
    /// Why.
    pub cause: String,
}

impl fmt::Display for MeshFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        write!(f, "{}{line}: {}", self.source, self.cause)
    }
}

impl From<&MeshEntry> for Entry {
    fn from(entry: &MeshEntry) -> Self {
        Self { class: entry.class.clone(), split: entry.split, name: entry.name.clone() }
    }
}

impl Entry {
    /// `CLASS/NAME`: what random numbers are keyed by.
    #[must_use]
    pub fn id(&self) -> String {
        format!("{}/{}", self.class, self.name)
    }
}
