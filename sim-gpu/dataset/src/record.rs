use crate::config::Variant;
use edgepuck_mesh::MeshError;
use edgepuck_mesh::frame::Up;
use edgepuck_mesh::tree::MeshEntry;
use edgepuck_mesh::validate::MeshDefects;
use formats::Split;
use formats::hash::FileHash;
use formats::plausible::Warning;
use formats::scan_file::ScanFormat;
use serde::{Deserialize, Serialize};
use sim_gpu::Tally;
use std::fmt;
use std::path::PathBuf;

/// A mesh of a dataset. Lists are sorted by it.
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
    /// The mesh.
    #[serde(flatten)]
    pub entry: Entry,
    /// The file, from the dataset's folder, with forward slashes.
    pub source: String,
    /// The hash of the file's bytes, if the configuration asks for one.
    #[serde(flatten)]
    pub hash: Option<FileHash>,
    /// The axis that points upwards.
    pub up: Up,
    /// The offset that was subtracted from the upright vertices; 0 if the mesh stays where it is.
    pub centre: [f64; 3],
    /// The factor by which they were then multiplied.
    pub scale: f64,
    /// What viewpoints stand around, metres: the origin, or the centre of the bounding box of a mesh
    /// that stays where it is.
    #[serde(default, skip_serializing_if = "is_origin")]
    pub views_around: [f64; 3],
    /// Triangles in the file, where polygons count as the triangles that they are cut into.
    pub triangles: u64,
    /// Faces of fewer than three corners.
    pub dropped_faces: u64,
    /// Defects of the triangles and vertices.
    #[serde(flatten)]
    pub defects: MeshDefects,
    /// Its scans: by set in the order of the configuration, then by view.
    pub scans: Vec<ScanRecord>,
    /// What is probably wrong with the file. Records that come from files have none.
    #[serde(skip)]
    pub warnings: Vec<Warning>,
}

fn is_origin(position: &[f64; 3]) -> bool {
    *position == [0.0; 3]
}

/// One view of one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScanRecord {
    /// The set.
    pub set: String,
    /// The view's number.
    pub view: u32,
    /// Its scans, in the order of the configured variants.
    pub variants: Vec<VariantRecord>,
}

/// One scan as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VariantRecord {
    /// Its effects.
    pub variant: Variant,
    /// How many returns became points or were lost.
    #[serde(flatten)]
    pub tally: Tally,
    /// The files, in the configuration's order of formats.
    pub files: Vec<FileRecord>,
    /// Its cloud, which waits in memory until it is packed. Records that come from files have
    /// none, nor do scans that exceed the memory for clouds: their scans are read again.
    #[serde(skip)]
    pub cloud: Option<Vec<[f32; 3]>>,
}

/// One file of a scan.
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
    /// The mesh.
    #[serde(flatten)]
    pub entry: Entry,
    /// The file, from the dataset's folder.
    pub source: String,
    /// The line of the error, if the file has lines.
    pub line: Option<u64>,
    /// The cause.
    pub cause: String,
}

impl MeshFailure {
    pub(crate) fn new(entry: &MeshEntry, cause: impl ToString) -> Self {
        let (source, cause) = (entry.relative.clone(), cause.to_string());
        Self { entry: entry.into(), source, line: None, cause }
    }

    pub(crate) fn unreadable(entry: &MeshEntry, error: &MeshError) -> Self {
        match error {
            MeshError::Malformed { line, cause, .. } => {
                Self { line: line.map(|line| line as u64), ..Self::new(entry, cause) }
            }
            other => Self::new(entry, other),
        }
    }
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
    /// `CLASS/NAME`, which keys the random numbers of the mesh.
    #[must_use]
    pub fn id(&self) -> String {
        format!("{}/{}", self.class, self.name)
    }

    /// The file of a scan of it, from the dataset's folder.
    #[must_use]
    pub fn scan_file(&self, set: &str, variant: Variant, view: u32, format: ScanFormat) -> PathBuf {
        let Self { class, split, name } = self;
        let folder = PathBuf::from_iter([set, variant.name(), class, split.name()]);
        folder.join(format!("{name}_v{view}.{format}"))
    }
}
