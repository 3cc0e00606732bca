//! The layers of a network, packed for the kernels of one precision.

use std::sync::atomic::{AtomicU32, Ordering};

use edgepuck_kernels::{Dense, F32, Format, Int8Prefilter, Kernels, Panels, Weight};
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::WeightsFile;

use crate::model::network::{Network, Role, read_network};

/// A network packed for format `T`.
pub type Layers<T> = Network<Conv<T>, Vector<T>>;

/// A point-wise layer.
pub enum Conv<T: Format> {
    /// Its inputs are coordinates; it computes in fp32 in every format.
    First(First),
    /// Its inputs are features.
    Inner(Packed<T>),
    /// Its inputs are features after the feature transform, as a layer of its own or multiplied
    /// into these weights, which are in plain fp32.
    Turned(Packed<T>, Panels<f32>),
}

/// A layer that takes coordinates.
pub struct First {
    pub panels: Panels<f32>,
    /// Its weights before packing, which are multiplied by the input transform.
    pub dense: Dense,
    /// The calibrated largest output.
    pub range: f32,
    /// The largest observed output.
    pub seen: Largest,
}

/// A layer that takes features.
pub struct Packed<T: Format> {
    pub name: String,
    pub panels: Panels<T::Weight>,
    /// The prefilter of its pooling, if that is faster.
    pub prefilter: Option<Int8Prefilter>,
    /// The calibrated largest output.
    pub range: f32,
    /// The largest observed output.
    pub seen: Largest,
}

/// A matrix `[inputs, outputs]` in C order, which is packed during a classification.
pub struct Matrix<'a> {
    /// The elements; rows are `stride` apart.
    pub data: &'a [f32],
    /// The distance from one row to the next.
    pub stride: usize,
}

/// A maximum that several threads update.
#[derive(Default)]
pub struct Largest(AtomicU32);

impl Largest {
    /// Raises the maximum to `values`; NaN and numbers below 0 do not count.
    pub fn observe(&self, values: &[f32]) {
        let largest = values.iter().copied().fold(0.0, f32::max);
        // The bits of nonnegative numbers have the order of the numbers.
        self.0.fetch_max(largest.to_bits(), Ordering::Relaxed);
    }

    /// The largest so far, or 0.
    pub fn get(&self) -> f32 {
        f32::from_bits(self.0.load(Ordering::Relaxed))
    }
}

/// A layer after a pooling.
pub struct Vector<T: Format> {
    pub columns: Panels<T::Weight>,
    /// Whether negative outputs become 0.
    pub relu: bool,
}

/// The assumed largest activation of a layer without calibration.
const UNKNOWN_RANGE: f32 = 1.0;

/// Reads and packs the network of `file`, with the calibrated ranges of `card`.
pub fn pack<T: Format>(
    file: &mut WeightsFile,
    card: &ModelCard,
    kernels: &Kernels,
) -> Result<Layers<T>, FormatError> {
    let packer = Packer { card, kernels };
    read_network(
        file,
        card,
        |dense, role| packer.conv::<T>(dense, role),
        |dense| Vector { columns: T::columns(&dense), relu: dense.relu },
    )
}

struct Packer<'a> {
    card: &'a ModelCard,
    kernels: &'a Kernels,
}

impl Packer<'_> {
    fn conv<T: Format>(&self, dense: Dense, role: Role) -> Conv<T> {
        match role {
            Role::First => Conv::First(self.first(dense)),
            Role::Inner => Conv::Inner(self.packed(&dense)),
            Role::Last => {
                let is_f32 = T::as_f32(&[], &mut []).is_some();
                let prefilter = is_f32.then(|| Int8Prefilter::new(&dense, self.kernels)).flatten();
                Conv::Inner(Packed { prefilter, ..self.packed(&dense) })
            }
            Role::AfterTransform => {
                let mut plain = empty::<F32>(self.kernels, &dense);
                plain.fill(|input, output| dense.at(input, output));
                // Bias and ReLU apply after the product with the transform.
                plain.biases_mut().fill(0.0);
                plain.relu = false;
                Conv::Turned(self.packed(&dense), plain)
            }
        }
    }

    fn first(&self, dense: Dense) -> First {
        let mut panels = empty::<F32>(self.kernels, &dense);
        panels.fill(|input, output| dense.at(input, output));
        First { panels, range: self.range(&dense.name), dense, seen: Largest::default() }
    }

    fn packed<T: Format>(&self, dense: &Dense) -> Packed<T> {
        let mut panels = empty::<T>(self.kernels, dense);
        let input_range = self.range(&self.before(&dense.name));
        T::Weight::fill(&mut panels, input_range, |input, output| dense.at(input, output));
        Packed {
            name: dense.name.clone(),
            panels,
            prefilter: None,
            range: self.range(&dense.name),
            seen: Largest::default(),
        }
    }

    fn range(&self, layer: &str) -> f32 {
        let range = self.card.activation_ranges.get(layer).copied();
        range.filter(|range| range.is_normal() && *range > 0.0).unwrap_or(UNKNOWN_RANGE)
    }

    /// The layer whose outputs layer `name` takes.
    fn before(&self, name: &str) -> String {
        let stem = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
        match name[stem.len()..].parse::<usize>() {
            Ok(number) if number > 1 => format!("{stem}{}", number - 1),
            // The feature T-Net branches off the trunk.
            _ => format!("feat.conv{}", self.card.transform_after),
        }
    }
}

/// Panels of zeros for `dense`, with its biases.
fn empty<T: Format>(kernels: &Kernels, dense: &Dense) -> Panels<T::Weight> {
    let mut panels = panels::<T>(kernels, dense.inputs, dense.outputs);
    panels.biases_mut()[..dense.outputs].copy_from_slice(&dense.bias);
    panels.relu = dense.relu;
    panels
}

/// Panels of zeros of a size.
///
/// # Panics
/// If `kernels` do not support this format; `Precision::runs_on` checks it when kernels are chosen.
pub fn panels<T: Format>(kernels: &Kernels, inputs: usize, outputs: usize) -> Panels<T::Weight> {
    let gemm = T::gemm(kernels).expect("invariant: kernels are chosen for the format");
    Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, T::GROUP))
}

impl First {
    /// Packs the product of the input transform `t` `[3, 3]` and this layer: the layer's input for
    /// a point p (a row) is p t. The weights of EdgeConv features stay the same.
    pub fn turn(&self, t: &[f32], panels: &mut Panels<f32>) {
        panels.fill(|input, output| match input {
            0..3 => (0..3).map(|j| t[input * 3 + j] * self.dense.at(j, output)).sum(),
            _ => self.dense.at(input, output),
        });
    }
}

impl<T: Format> Packed<T> {
    /// A layer of zeros, which [`Packed::set`] fills later.
    pub fn zeros(kernels: &Kernels, inputs: usize, outputs: usize) -> Self {
        let mut panels = panels::<T>(kernels, inputs, outputs);
        // This also allocates the scales, if the format has them, so that `set` allocates nothing.
        T::Weight::fill(&mut panels, UNKNOWN_RANGE, |_, _| 0.0);
        Self {
            name: String::new(),
            panels,
            prefilter: None,
            range: UNKNOWN_RANGE,
            seen: Largest::default(),
        }
    }

    /// Packs `matrix`, which has this layer's size, for inputs of at most `range`.
    pub fn set(&mut self, matrix: &Matrix<'_>, range: f32) {
        let at = |input: usize, output: usize| matrix.data[input * matrix.stride + output];
        T::Weight::fill(&mut self.panels, range, at);
    }

    /// Columns of a row of outputs, padding included.
    pub fn width(&self) -> usize {
        self.panels.padded_outputs()
    }
}

impl<T: Format> Conv<T> {
    /// The layer, if its inputs are coordinates.
    ///
    /// # Panics
    /// If they are features; [`read_network`] assigns the roles.
    pub fn first(&self) -> &First {
        match self {
            Self::First(first) => first,
            _ => unreachable!("invariant: the first layer takes coordinates"),
        }
    }

    /// The layer, if its inputs are features.
    pub fn packed(&self) -> &Packed<T> {
        match self {
            Self::Inner(packed) | Self::Turned(packed, _) => packed,
            Self::First(_) => unreachable!("invariant: only the first layer takes coordinates"),
        }
    }

    /// Columns of a row of outputs, padding included.
    pub fn width(&self) -> usize {
        match self {
            Self::First(first) => first.panels.padded_outputs(),
            _ => self.packed().width(),
        }
    }
}
