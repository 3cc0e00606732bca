//! How a classifier computes.

use formats::model_card::Normalization;

use crate::kernel::KernelName;
use crate::precision::Precision;
use crate::sampler::SamplerSpec;

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
    /// Which points the network sees; as in training if `None`.
    pub sampler: Option<SamplerSpec>,
    /// Replaces the front end of a Critical Points Layer by a look-up table of
    /// this many nodes an axis.
    pub table_nodes: Option<usize>,
    /// How clouds are normalised; as in training if `None`.
    pub normalization: Option<Normalization>,
    /// Drop points that are not finite instead of refusing the cloud.
    pub drop_invalid: bool,
    /// Draws of a random subset whose log-probabilities are averaged.
    pub votes: u32,
    /// Turn the cloud about its up axis between votes, evenly spread.
    pub vote_rotations: bool,
    /// The axis that points up: 0 for x, 1 for y, 2 for z.
    pub up: usize,
    /// Points to make room for at once; larger clouds allocate when they come.
    pub capacity: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            kernel: None,
            threads: 1,
            sampler: None,
            table_nodes: None,
            normalization: None,
            drop_invalid: false,
            votes: 1,
            vote_rotations: false,
            up: 2,
            capacity: 4096,
        }
    }
}
