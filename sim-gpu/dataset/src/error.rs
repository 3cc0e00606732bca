//! Why a dataset cannot be made, merged or verified.

use super::record::MeshFailure;
use formats::FormatError;
use sim_gpu::internals::cast_error::CastError;
use sim_gpu::internals::config::InvalidValue;
use sim_gpu::internals::scan::ScanError;
use std::path::{Path, PathBuf};

/// Why a dataset cannot be made, merged or verified. A bad mesh is no such
/// error: it is a [`super::MeshFailure`].
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The folder holds something already.
    #[error(
        "{}: holds {what} already; continue it with --resume, replace it with --overwrite, or \
         choose another folder with --out", path.display()
    )]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// What it holds.
        what: &'static str,
    },
    /// A dataset that has been described already.
    #[error("{}: is there already; replace it with --overwrite", path.display())]
    Published {
        /// The file.
        path: PathBuf,
    },
    /// A run that was not finished.
    #[error("{}: is not finished; continue it with --resume", path.display())]
    Unfinished {
        /// The folder.
        path: PathBuf,
    },
    /// No manifest where a finished dataset has one.
    #[error("{}: expected a finished dataset's manifest, found no file", path.display())]
    NoManifest {
        /// The manifest's place.
        path: PathBuf,
    },
    /// The run was told to end.
    #[error("stopped after {done} of {of} {what}; continue with --resume")]
    Interrupted {
        /// What is done.
        done: usize,
        /// Of how many.
        of: usize,
        /// Meshes or tars.
        what: &'static str,
    },
    /// Tars are complete, but the command that takes them failed.
    #[error("{tars} tars were not handed over, {first} the first: {cause}; --resume tries again")]
    NotHandedOver {
        /// How many.
        tars: usize,
        /// The name of the first.
        first: String,
        /// Why it was not.
        cause: String,
    },
    /// A layout that cannot hold the dataset.
    #[error("layout {layout}: {cause}")]
    Layout {
        /// The layout's name.
        layout: &'static str,
        /// Why.
        cause: &'static str,
    },
    /// An unfinished or finished run in the folder was another one.
    #[error("{}: was begun with other settings: {difference}", path.display())]
    Different {
        /// The folder.
        path: PathBuf,
        /// The first difference.
        difference: String,
    },
    /// A record or a manifest cannot be read.
    #[error("{}: {cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// Shards do not make one dataset.
    #[error("{}: {cause}", path.display())]
    Shard {
        /// The shard's folder.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// A mesh of which a cloud is wanted cannot be scanned.
    #[error("{0}")]
    Mesh(MeshFailure),
    /// No view that was tried of a mesh has enough points for a cloud.
    #[error(
        "{source_file}: expected a view of at least {least} points, found at most {most} in \
         {tried} views"
    )]
    Sparse {
        /// The mesh, from the dataset's folder.
        source_file: String,
        /// How many points a cloud takes.
        least: u32,
        /// How many points the best view has.
        most: u64,
        /// How many views were tried.
        tried: u32,
    },
    /// A setting is bad.
    #[error(transparent)]
    Invalid(#[from] InvalidValue),
    /// A file cannot be read or written.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The adapter failed.
    #[error(transparent)]
    Gpu(#[from] CastError),
    /// A scan cannot be made.
    #[error(transparent)]
    Scan(#[from] ScanError),
}

impl DatasetError {
    /// The system's error `source` on `path`.
    pub(super) fn io(path: &Path, source: std::io::Error) -> Self {
        FormatError::io(path, source).into()
    }
}
