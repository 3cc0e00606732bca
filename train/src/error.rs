//! The errors of training.

use std::path::PathBuf;

use formats::FormatError;

/// An error of training.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or written, or is malformed.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Data that cannot be used for training.
    #[error("{}: {cause}", path.display())]
    Data {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A value in a recipe that is out of its limits.
    #[error("recipe: `{key}`: {cause}")]
    Recipe {
        /// The key in the file.
        key: &'static str,
        /// The cause.
        cause: String,
    },
    /// A loss that is not finite.
    #[error(
        "expected a finite loss, found {loss} at step {step} of epoch {epoch}; {layer} is the first \
         layer whose output is not finite. Lower `adam.rate`, or look for extreme clouds in that \
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
    /// A checkpoint of another run.
    #[error("{}: expected a checkpoint of this run: {cause}", path.display())]
    OtherRun {
        /// The checkpoint.
        path: PathBuf,
        /// The difference.
        cause: String,
    },
    /// A run's folder in which another process trains.
    #[error(
        "{}: expected the folder of a run that no other process trains, found another `train` in it: \
         wait until that ends, or choose another --out", path.display()
    )]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// A model or a cloud that infer-cpu refuses.
    #[error(transparent)]
    Infer(#[from] infer_cpu::Error),
}
