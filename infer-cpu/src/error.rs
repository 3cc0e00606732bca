use edgepuck_kernels::KernelName;
use formats::FormatError;

use crate::limits::{MOST_POINTS, MOST_THREADS};

/// An error of loading a model or classifying a cloud.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file cannot be read, or has the wrong format.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A model of whole objects was to classify clusters of a scan.
    #[error("{0}")]
    WholeObjects(String),
    /// The cloud has no points.
    #[error("the cloud has no points that are finite and not at 0, 0, 0")]
    NoPoints,
    /// A coordinate is NaN or infinite.
    #[error("point {index}: expected finite coordinates, found ({}, {}, {})", .point[0], .point[1], .point[2])]
    NotFinite {
        /// The point's index in the cloud.
        index: usize,
        /// Its coordinates.
        point: [f64; 3],
    },
    /// An evaluation has a label without a class in the model.
    #[error("expected labels below {n_classes}, the model's number of classes, found {label}")]
    UnknownLabel {
        /// The label.
        label: usize,
        /// The number of classes of the model.
        n_classes: usize,
    },
    /// More points than a 32-bit index can count.
    #[error("expected at most 4,294,967,295 points, found {0}")]
    TooManyPoints(usize),
    /// This machine cannot run the requested kernel.
    #[error("this machine cannot run the kernel {0}; it runs {here}", here = names_here())]
    KernelMissing(KernelName),
    /// The requested kernel does not support the precision.
    #[error("the kernel {kernel} does not compute in {precision}")]
    KernelPrecision {
        /// The kernel.
        kernel: KernelName,
        /// The precision.
        precision: crate::Precision,
    },
    /// Arithmetic left the range of f32.
    #[error("the network overflows on this cloud: its logits are not finite")]
    Overflow,
    /// The sampler is invalid, or cannot sample this cloud.
    #[error(transparent)]
    Sampler(#[from] crate::sampler::SamplerError),
    /// The model lacks the front end for a Critical Points Layer.
    #[error("the sampler cpl cannot use the front end `{choice}`: the model has {what}")]
    FrontMissing {
        /// The requested front end.
        choice: crate::sampler::FrontChoice,
        /// What the model has instead.
        what: &'static str,
    },
    /// The capacity exceeds 2^28 points.
    #[error("expected a capacity of at most {MOST_POINTS} points, found {0}")]
    TooMuchRoom(usize),
    /// The number of threads exceeds 1024.
    #[error("expected at most {MOST_THREADS} threads, found {0}")]
    TooManyThreads(usize),
    /// A thread could not be started.
    #[error("cannot start {threads} threads: {source}")]
    Threads {
        /// The requested number of threads.
        threads: usize,
        /// The error of the operating system.
        source: std::io::Error,
    },
}

fn names_here() -> String {
    let names: Vec<&str> = crate::kernel::available().map(|kernels| kernels.name.name()).collect();
    names.join(", ")
}
