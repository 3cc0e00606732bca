use crate::record::MeshFailure;
use formats::FormatError;
use sim_gpu::errors::CastError;
use sim_gpu::errors::InvalidValue;
use sim_gpu::errors::ScanError;
use std::path::{Path, PathBuf};

/// Why a dataset cannot be made, merged or verified. A mesh that cannot be scanned does not stop a
/// run: it is a [`MeshFailure`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The folder holds a dataset already.
    #[error(
        "{}: holds {what} already; continue it with --resume, replace it with --overwrite, or \
         choose another folder with --out", path.display()
    )]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// The dataset, finished or not, or tars.
        what: &'static str,
    },
    /// A file or a folder that no run made stands where a dataset's would go.
    #[error("{}: {what}, where a dataset's would go: move it, or choose another folder with --out",
        path.display()
    )]
    InTheWay {
        /// The file or the folder.
        path: PathBuf,
        /// What it is.
        what: String,
    },
    /// The dataset is not finished.
    #[error("{}: is not finished; continue it with --resume", path.display())]
    Unfinished {
        /// The folder.
        path: PathBuf,
    },
    /// The folder of a dataset has no manifest.
    #[error("{}: expected a finished dataset's manifest, found no file", path.display())]
    NoManifest {
        /// The path of the manifest.
        path: PathBuf,
    },
    /// The run was stopped.
    #[error("stopped after {done} of {of} {what}; --resume continues")]
    Interrupted {
        /// The number that is done.
        done: usize,
        /// The number of all.
        of: usize,
        /// Meshes or tars.
        what: &'static str,
    },
    /// Tars are complete but could not be handed over.
    #[error("{tars} tars were not handed over, {first} the first: {cause}; --resume tries again")]
    NotHandedOver {
        /// The number of tars.
        tars: usize,
        /// The name of the first.
        first: String,
        /// Why it could not be handed over.
        cause: String,
    },
    /// A layout cannot hold the dataset.
    #[error("layout {layout}: {cause}")]
    Layout {
        /// The layout's name.
        layout: &'static str,
        /// The cause.
        cause: &'static str,
    },
    /// The folder holds a dataset with other settings.
    #[error("{}: was begun with other settings: {difference}", path.display())]
    Different {
        /// The folder.
        path: PathBuf,
        /// The first difference.
        difference: String,
    },
    /// A file or a shard is not as expected.
    #[error("{}: {cause}", path.display())]
    Malformed {
        /// The file, or the folder of the shard.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A mesh cannot be scanned.
    #[error("{0}")]
    Mesh(MeshFailure),
    /// No view of a mesh has enough points for a cloud.
    #[error(
        "{source_file}: expected a view of at least {least} points, found at most {most} in \
         {tried} views"
    )]
    Sparse {
        /// The mesh, from the dataset's folder.
        source_file: String,
        /// The points that a view needs.
        least: u32,
        /// The points of the best view.
        most: u64,
        /// The number of views that were tried.
        tried: u32,
    },
    /// The system does not start this number of threads.
    #[error("cannot start {0} threads: {1}; set RAYON_NUM_THREADS=1 to use fewer")]
    Threads(usize, #[source] std::io::Error),
    /// A setting is invalid.
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

impl From<MeshFailure> for DatasetError {
    fn from(failure: MeshFailure) -> Self {
        Self::Mesh(failure)
    }
}

impl DatasetError {
    pub(crate) fn malformed(path: &Path, cause: impl ToString) -> Self {
        Self::Malformed { path: path.into(), cause: cause.to_string() }
    }

    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        FormatError::io(path, source).into()
    }
}
