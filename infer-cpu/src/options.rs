use std::collections::BTreeMap;

use formats::model_card::Normalization;

use crate::kernel::KernelName;
use crate::precision::Precision;
use crate::sampler::SamplerSpec;

formats::named! {
    /// The axis of a cloud that points up.
    #[derive(Default)]
    pub enum UpAxis: "up axis" {
        /// x.
        X = "x",
        /// y, as in ModelNet40's files.
        Y = "y",
        /// z, as in scans.
        #[default]
        Z = "z",
    }
}

impl UpAxis {
    /// The two axes of the plane of rotation about this axis; a rotation turns the first towards
    /// the second.
    pub(crate) fn others(self) -> [usize; 2] {
        match self {
            Self::X => [1, 2],
            Self::Y => [2, 0],
            Self::Z => [0, 1],
        }
    }
}

/// The options of a [`crate::Classifier`].
///
/// ```
/// use infer_cpu::sampler::{SamplerKind, SamplerSpec};
/// use infer_cpu::{Options, Precision};
///
/// let sampler = SamplerSpec { kind: SamplerKind::Cpl, points: 64, ..SamplerSpec::default() };
/// let options = Options {
///     precision: Precision::F16,
///     threads: 4,
///     sampler: Some(sampler),
///     ..Options::default()
/// };
/// assert!(!options.drop_invalid);
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// The number format of the network.
    pub precision: Precision,
    /// The kernels; the fastest ones of this machine if `None`.
    pub kernel: Option<KernelName>,
    /// The number of threads, including the caller's.
    pub threads: usize,
    /// The sampler that chooses the points for the network; as in training if `None`.
    pub sampler: Option<SamplerSpec>,
    /// The largest activation of each layer, for int8. If `None`, the model's own calibration, or
    /// that of generated shapes if the model has none.
    pub activation_ranges: Option<BTreeMap<String, f32>>,
    /// The normalisation of clouds; as in training if `None`.
    pub normalization: Option<Normalization>,
    /// Whether outliers are dropped before sampling, for clouds in the unit sphere; as in training
    /// if `None`.
    pub outlier_filter: Option<bool>,
    /// Whether points that are not finite are dropped; otherwise they are an error.
    pub drop_invalid: bool,
    /// The number of classifications, with different random draws or rotations, whose
    /// log-probabilities are averaged.
    pub votes: u32,
    /// Whether the cloud is rotated about its up axis between votes, in equal steps.
    pub vote_rotations: bool,
    /// The axis that points up.
    pub up: UpAxis,
    /// The number of points for which memory is allocated at loading; larger clouds allocate later.
    pub capacity: usize,
}

/// The largest capacity.
pub const MOST_POINTS: usize = 1 << 28;

pub const MOST_THREADS: usize = 1024;

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            kernel: None,
            threads: 1,
            sampler: None,
            activation_ranges: None,
            normalization: None,
            outlier_filter: None,
            drop_invalid: false,
            votes: 1,
            vote_rotations: false,
            up: UpAxis::Z,
            capacity: 4096,
        }
    }
}
