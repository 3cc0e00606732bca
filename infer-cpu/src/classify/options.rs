use std::collections::BTreeMap;

use edgepuck_kernels::KernelName;
use formats::model_card::Normalization;

use crate::precision::Precision;
use crate::sampler::SamplerSpec;

/// The options of a [`crate::Classifier`].
///
/// ```
/// use infer_cpu::sampler::{SamplerKind, SamplerSpec};
/// use infer_cpu::{Options, Precision};
///
/// let sampler = SamplerSpec { kind: SamplerKind::Cpl, points: 64, ..SamplerSpec::default() };
/// let options = Options {
///     precision: Precision::I8,
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
    /// Whether points that are not finite are dropped; otherwise they are an error.
    pub drop_invalid: bool,
    /// The number of points for which memory is allocated at loading; larger clouds allocate later.
    pub capacity: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            kernel: None,
            threads: 1,
            sampler: None,
            activation_ranges: None,
            normalization: None,
            drop_invalid: false,
            capacity: 4096,
        }
    }
}
