//! The number formats of a forward pass: how each packs weights and rounds activations.

use std::marker::PhantomData;

use half::f16;

use crate::dense::Dense;
use crate::kernel::{Gemm, Gemv, I8_LARGEST, Kernels, Panels, Sum};

/// The largest finite number of fp16.
pub const F16_LARGEST: f32 = 65504.0;

formats::named! {
    /// The number format of a network.
    #[derive(Default)]
    pub enum Precision: "precision" {
        /// fp32 throughout.
        #[default]
        F32 = "f32",
        /// fp32 arithmetic throughout; the weights of the layers after a pooling, whose cost is
        /// memory traffic, are stored in fp16.
        F32Fc16 = "f32-fc16",
        /// fp16 weights and activations, and fp16 sums over short chunks; vector layers as in
        /// [`Precision::F32Fc16`].
        F16 = "f16",
        /// int8 weights (one scale per channel) and seven-bit activations (one calibrated scale per
        /// layer). The first layer, whose inputs are coordinates, is in fp32; vector layers have
        /// int8 weights and fp32 arithmetic.
        I8 = "i8",
    }
}

impl Precision {
    /// Whether `kernels` support it.
    #[must_use]
    pub fn runs_on(self, kernels: &Kernels) -> bool {
        let has_products = match self {
            Self::F32 | Self::F32Fc16 => true,
            Self::F16 => kernels.f16.is_some(),
            Self::I8 => kernels.i8.is_some(),
        };
        has_products && kernels.f32.is_some()
    }
}

/// The range events of rounding a layer's outputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rounded {
    /// The largest magnitude before rounding, or 0 if the format cannot overflow.
    pub largest: f32,
    /// The number of values above the calibrated range.
    pub clipped: u64,
}

/// A matrix `[inputs, outputs]` in C order, which is packed during a classification.
pub struct Matrix<'a> {
    /// The elements; rows are `stride` apart.
    pub data: &'a [f32],
    /// The distance from one row to the next.
    pub stride: usize,
}

/// A number type of stored weights.
pub trait Weight: Copy + Default + Send + Sync + 'static {
    /// The matrix-vector products of `kernels` with such weights.
    fn gemv(kernels: &Kernels) -> Gemv<Self>;
    /// Packs the weights `weight(input, output)` of a layer whose inputs are at most `range` into
    /// `panels`, and sets the scales.
    fn fill(panels: &mut Panels<Self>, range: f32, weight: impl Fn(usize, usize) -> f32);
}

impl Weight for f32 {
    fn gemv(kernels: &Kernels) -> Gemv<f32> {
        kernels.gemv_f32
    }

    fn fill(panels: &mut Panels<f32>, _: f32, weight: impl Fn(usize, usize) -> f32) {
        panels.fill(weight);
    }
}

impl Weight for f16 {
    fn gemv(kernels: &Kernels) -> Gemv<f16> {
        kernels.gemv_f16
    }

    fn fill(panels: &mut Panels<f16>, _: f32, weight: impl Fn(usize, usize) -> f32) {
        panels.fill(|input, output| f16::from_f32(weight(input, output)));
    }
}

impl Weight for i8 {
    fn gemv(kernels: &Kernels) -> Gemv<i8> {
        kernels.gemv_i8
    }

    fn fill(panels: &mut Panels<i8>, range: f32, weight: impl Fn(usize, usize) -> f32) {
        let per_activation = range / f32::from(I8_LARGEST);
        for output in 0..panels.outputs() {
            let weights = (0..panels.inputs()).map(|input| weight(input, output));
            let largest = weights.fold(0.0f32, |largest, weight| largest.max(weight.abs()));
            // The step maps the largest weight to ±127. If all weights are zero or denormal, any
            // step will do.
            let step = (largest / 127.0).max(f32::MIN_POSITIVE);
            for input in 0..panels.inputs() {
                let level = (weight(input, output) / step).round_ties_even() as i8;
                panels.set(input, output, level);
            }
            panels.scales_mut()[output] = step * per_activation;
        }
    }
}

/// One precision's types and roundings.
pub trait Format: Send + Sync + 'static {
    /// An activation between point-wise layers.
    type Activation: Copy + Default + Send + Sync;
    /// A weight of a point-wise layer.
    type Weight: Weight;
    type Sum: Sum;
    /// A stored weight of a vector layer.
    type Stored: Weight;

    /// Below every sum.
    const LOWEST: Self::Sum;
    /// The number of adjacent inputs in a panel.
    const GROUP: usize = 1;
    /// Whether activations may be negative.
    const SIGNED: bool = true;

    /// The matrix products of `kernels` in this format, if they support it.
    fn gemm(kernels: &Kernels) -> Option<&Gemm<Self::Activation, Self::Weight, Self::Sum>>;
    /// Rounds outputs of a layer whose largest activation is `range`.
    fn narrow(
        kernels: &Kernels,
        values: &[f32],
        range: f32,
        out: &mut [Self::Activation],
    ) -> Rounded;

    /// Packs a vector layer.
    fn columns(dense: &Dense) -> Panels<Self::Stored> {
        let mut columns = Panels::columns(dense.inputs, dense.outputs);
        columns.biases_mut()[..dense.outputs].copy_from_slice(&dense.bias);
        // Inputs are fp32: with a range equal to the number of levels, the scales are those of the
        // weights.
        let range = f32::from(I8_LARGEST);
        Self::Stored::fill(&mut columns, range, |input, output| dense.at(input, output));
        columns
    }

    /// Activations and maxima as fp32 slices, if the format is fp32, for the
    /// [`Int8Prefilter`](crate::prefilter::Int8Prefilter).
    fn as_f32<'a>(
        _: &'a [Self::Activation],
        _: &'a mut [Self::Sum],
    ) -> Option<(&'a [f32], &'a mut [f32])> {
        None
    }
}

/// fp32, with weights of vector layers stored as `S`.
pub struct Single<S>(PhantomData<S>);
pub type F32 = Single<f32>;
pub type F32Fc16 = Single<f16>;
pub struct F16;
pub struct I8;

impl<S: Weight> Format for Single<S> {
    type Activation = f32;
    type Weight = f32;
    type Sum = f32;
    type Stored = S;
    const LOWEST: f32 = f32::NEG_INFINITY;

    fn gemm(kernels: &Kernels) -> Option<&Gemm<f32, f32, f32>> {
        kernels.f32.as_ref()
    }

    fn narrow(_: &Kernels, values: &[f32], _: f32, out: &mut [f32]) -> Rounded {
        out.copy_from_slice(values);
        Rounded::default()
    }

    fn as_f32<'a>(
        activations: &'a [f32],
        maxima: &'a mut [f32],
    ) -> Option<(&'a [f32], &'a mut [f32])> {
        Some((activations, maxima))
    }
}

impl Format for F16 {
    type Activation = f16;
    type Weight = f16;
    type Sum = f32;
    type Stored = f16;
    const LOWEST: f32 = f32::NEG_INFINITY;

    fn gemm(kernels: &Kernels) -> Option<&Gemm<f16, f16, f32>> {
        kernels.f16.as_ref()
    }

    fn narrow(kernels: &Kernels, values: &[f32], _: f32, out: &mut [f16]) -> Rounded {
        Rounded { largest: (kernels.narrow_f16)(values, out), clipped: 0 }
    }
}

impl Format for I8 {
    type Activation = u8;
    type Weight = i8;
    type Sum = i32;
    type Stored = i8;
    const LOWEST: i32 = i32::MIN;
    const GROUP: usize = 4;
    const SIGNED: bool = false;

    fn gemm(kernels: &Kernels) -> Option<&Gemm<u8, i8, i32>> {
        kernels.i8.as_ref()
    }

    fn narrow(kernels: &Kernels, values: &[f32], range: f32, out: &mut [u8]) -> Rounded {
        let per_unit = f32::from(I8_LARGEST) / range;
        Rounded { largest: 0.0, clipped: (kernels.narrow_i8)(values, per_unit, out) }
    }
}
