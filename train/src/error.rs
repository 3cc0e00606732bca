//! What can go wrong in training.

use std::path::PathBuf;

use formats::FormatError;

/// An error of training.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read or written, or is not what it should be.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Data that nothing can be learnt from.
    #[error("{}: {cause}", path.display())]
    Data {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// A recipe that makes no sense.
    #[error("recipe: `{key}`: {cause}")]
    Recipe {
        /// The key in the file.
        key: &'static str,
        /// What is wrong with its value.
        cause: String,
    },
    /// A loss that is not finite any more.
    #[error(
        "the loss is {loss} at step {step} of epoch {epoch}; the first layer whose output is not \
         finite is {layer}. Lower `adam.rate`, or look for extreme clouds in that batch"
    )]
    NotFinite {
        /// The loss.
        loss: f64,
        /// Counted from 1, within its epoch.
        step: u64,
        /// Counted from 1.
        epoch: u32,
        /// The layer.
        layer: String,
    },
    /// A checkpoint of other training.
    #[error("{} is of another run: {cause}", path.display())]
    OtherRun {
        /// The checkpoint.
        path: PathBuf,
        /// What differs.
        cause: String,
    },
    /// A trained network that infer-cpu refuses.
    #[error(transparent)]
    Infer(#[from] infer_cpu::Error),
}
