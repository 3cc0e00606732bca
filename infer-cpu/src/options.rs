//! How a classifier computes.

use std::collections::BTreeMap;

use formats::model_card::Normalization;

use crate::kernel::KernelName;
use crate::precision::Precision;
use crate::sampler::SamplerSpec;

formats::named! {
    /// Which of a model's T-Nets are run; one that is left out counts as the
    /// identity.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum TNets: "choice of T-Nets" {
        /// All that the model has.
        #[default]
        Both = "both",
        /// That of the coordinates alone.
        Input = "input",
        /// That of the features alone.
        Feature = "feature",
        /// None.
        Neither = "none",
    }
}

impl TNets {
    pub(crate) fn runs_input(self) -> bool {
        matches!(self, Self::Both | Self::Input)
    }

    pub(crate) fn runs_feature(self) -> bool {
        matches!(self, Self::Both | Self::Feature)
    }
}

/// The axis of a cloud that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UpAxis {
    /// x.
    X,
    /// y, as in ModelNet40's files.
    Y,
    /// z, as in scans.
    #[default]
    Z,
}

impl UpAxis {
    /// The two axes that a rotation about this one turns, the first towards
    /// the second.
    pub(crate) fn others(self) -> [usize; 2] {
        match self {
            Self::X => [1, 2],
            Self::Y => [2, 0],
            Self::Z => [0, 1],
        }
    }
}

/// How a [`crate::Classifier`] computes.
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
    /// What to compute in.
    pub precision: Precision,
    /// The kernels to use; the fastest that this machine runs if `None`.
    pub kernel: Option<KernelName>,
    /// Threads, the caller's among them.
    pub threads: usize,
    /// Which T-Nets to run.
    pub t_nets: TNets,
    /// Which points the network sees; as in training if `None`.
    pub sampler: Option<SamplerSpec>,
    /// The largest activation of each layer, for int8; the model's own
    /// calibration if `None`, and shapes made by rule if it has none.
    pub activation_ranges: Option<BTreeMap<String, f32>>,
    /// How clouds are normalised; as in training if `None`.
    pub normalization: Option<Normalization>,
    /// Whether outliers are dropped before the sampler, of clouds in the unit sphere; as
    /// in training if `None`.
    pub outlier_filter: Option<bool>,
    /// Drop points that are not finite instead of refusing the cloud.
    pub drop_invalid: bool,
    /// Draws of a random subset whose log-probabilities are averaged.
    pub votes: u32,
    /// Turn the cloud about its up axis between votes, evenly spread.
    pub vote_rotations: bool,
    /// The axis that points up.
    pub up: UpAxis,
    /// Points to make room for at once; larger clouds allocate when they come.
    pub capacity: usize,
}

/// Most points that room is made for at once.
pub const MOST_POINTS: usize = 1 << 28;

/// Most threads of a team.
pub const MOST_THREADS: usize = 1024;

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            kernel: None,
            threads: 1,
            t_nets: TNets::Both,
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
