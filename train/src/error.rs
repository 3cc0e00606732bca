//! The errors of training.

use std::path::PathBuf;

use formats::{FormatError, InvalidValue};

/// An error of training.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or written, or is malformed.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Data that cannot be used for training, or the run of other data.
    #[error("{}: {cause}", path.display())]
    Data {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A value in a recipe that is out of its limits.
    #[error("recipe: {0}")]
    Recipe(#[from] InvalidValue),
    /// A loss that is not finite.
    #[error(
        "expected a finite loss, found {loss} at step {step} of epoch {epoch}; {layer} is the first \
         layer whose output is not finite. Lower `rate`, or look for extreme clouds in that \
         batch"
    )]
    NotFinite {
        /// The loss.
        loss: f64,
        /// The step of the epoch, counted from 1.
        step: u64,
        /// The epoch, counted from 1.
        epoch: u32,
        /// The first layer whose output is not finite.
        layer: String,
    },
    /// The system does not start the thread that prepares batches.
    #[error("cannot start 1 thread: {0}")]
    Thread(#[source] std::io::Error),
    /// A model or a cloud that infer-cpu refuses.
    #[error(transparent)]
    Infer(#[from] infer_cpu::Error),
}

impl Error {
    pub(crate) fn data(path: impl Into<PathBuf>, cause: impl Into<String>) -> Self {
        Self::Data { path: path.into(), cause: cause.into() }
    }
}
