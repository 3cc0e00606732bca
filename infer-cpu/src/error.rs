//! What can go wrong between a model file, a cloud and a class.

use formats::FormatError;

use crate::kernel::KernelName;
use crate::options::{MOST_POINTS, MOST_THREADS};

/// An error of loading a model or classifying a cloud.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read, or is not what it should be.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A cloud without points has no class.
    #[error("the cloud has no points")]
    NoPoints,
    /// A coordinate is NaN or infinite.
    #[error("point {index}: expected finite coordinates, found ({x}, {y}, {z})")]
    NotFinite {
        /// The point's place in the cloud, from 0.
        index: usize,
        /// Its coordinates.
        x: f64,
        /// Its coordinates.
        y: f64,
        /// Its coordinates.
        z: f64,
    },
    /// A label of an evaluation that the model has no class for.
    #[error("expected labels below {n_classes}, the model's number of classes, found {label}")]
    UnknownLabel {
        /// The label.
        label: usize,
        /// How many classes the model has.
        n_classes: usize,
    },
    /// More points than their indices can count.
    #[error("expected at most 4,294,967,295 points, found {0}")]
    TooManyPoints(usize),
    /// The kernel that was asked for does not run here.
    #[error("this machine cannot run the kernel {0}; it runs {here}", here = names_here())]
    KernelMissing(KernelName),
    /// The kernel that was asked for has no such precision.
    #[error("the kernel {kernel} does not compute in {precision}")]
    KernelPrecision {
        /// The kernel.
        kernel: KernelName,
        /// The precision.
        precision: crate::Precision,
    },
    /// Outliers are sought in clouds of the unit sphere alone.
    #[error("expected clouds normalised to unit-sphere for the outlier filter, found {0}")]
    OutlierFilter(formats::model_card::Normalization),
    /// Arithmetic left the range of f32.
    #[error("the network overflows on this cloud: its logits are not finite")]
    Overflow,
    /// Points cannot be chosen as asked.
    #[error(transparent)]
    Sampler(#[from] crate::sampler::SamplerError),
    /// The model lacks the front end that a Critical Points Layer was to pool.
    #[error("the sampler cpl cannot use the front end `{choice}`: the model has {what}")]
    FrontMissing {
        /// What was asked for.
        choice: crate::sampler::FrontChoice,
        /// What the model has or lacks.
        what: &'static str,
    },
    /// TestTimeAugmentation draw random subsets; another sampler has one opinion only.
    #[error(
        "expected the sampler random or rotations for several votes, found the sampler {0}, whose votes would all be the same"
    )]
    VotesWithoutDraws(crate::sampler::SamplerKind),
    /// Room for more points than memory could hold.
    #[error("expected a capacity of at most {MOST_POINTS} points, found {0}")]
    TooMuchRoom(usize),
    /// More threads than any machine has cores.
    #[error("expected at most {MOST_THREADS} threads, found {0}")]
    TooManyThreads(usize),
    /// Workers could not be started.
    #[error("cannot start {threads} threads: {source}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        source: std::io::Error,
    },
}

/// The kernels that this machine runs.
fn names_here() -> String {
    let names: Vec<&str> = crate::kernel::available().map(|kernels| kernels.name.name()).collect();
    names.join(", ")
}
