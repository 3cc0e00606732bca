//! The number formats of kernels: how each packs weights and rounds activations.

use crate::{Dense, Gemm, Gemv, I8_LARGEST, Kernels, Panels, Sum};

/// A number type of stored weights.
pub trait Weight: Copy + Default + Send + Sync + 'static {
    /// The matrix-vector products of `kernels` with such weights.
    fn gemv(kernels: &Kernels) -> Gemv<Self>;
    /// Packs the weights `weight(input, output)` of a layer whose inputs are at most `range` into
    /// `panels`, and sets the scales.
    fn fill(panels: &mut Panels<Self>, range: f32, weight: impl Fn(usize, usize) -> f32);
}

impl Weight for f32 {
    #[inline]
    fn gemv(kernels: &Kernels) -> Gemv<f32> {
        kernels.gemv_f32
    }

    fn fill(panels: &mut Panels<f32>, _: f32, weight: impl Fn(usize, usize) -> f32) {
        panels.fill(weight);
    }
}

impl Weight for i8 {
    #[inline]
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
    /// A weight.
    type Weight: Weight;
    /// A sum of products.
    type Sum: Sum;

    /// Below every sum.
    const LOWEST: Self::Sum;
    /// The number of adjacent inputs in a panel.
    const GROUP: usize = 1;
    /// Whether activations may be negative.
    const SIGNED: bool = true;

    /// The matrix products of `kernels` in this format, if they support it.
    fn gemm(kernels: &Kernels) -> Option<&Gemm<Self::Activation, Self::Weight, Self::Sum>>;
    /// Rounds outputs of a layer whose largest activation is `range`. Returns the number of values
    /// above the range, which were clipped.
    fn narrow(kernels: &Kernels, values: &[f32], range: f32, out: &mut [Self::Activation]) -> u64;

    /// Packs a vector layer.
    fn columns(dense: &Dense) -> Panels<Self::Weight> {
        let mut columns = Panels::columns(dense.inputs, dense.outputs);
        columns.biases_mut()[..dense.outputs].copy_from_slice(&dense.bias);
        // Inputs are fp32: with a range equal to the number of levels, the scales are those of the
        // weights.
        let range = f32::from(I8_LARGEST);
        Self::Weight::fill(&mut columns, range, |input, output| dense.at(input, output));
        columns
    }

    /// Activations and maxima as fp32 slices, if the format is fp32, for the
    /// [`Int8Prefilter`](crate::Int8Prefilter).
    #[inline]
    fn as_f32<'a>(
        _: &'a [Self::Activation],
        _: &'a mut [Self::Sum],
    ) -> Option<(&'a [f32], &'a mut [f32])> {
        None
    }
}

/// fp32 throughout.
pub struct F32;

/// Seven-bit activations, int8 weights.
pub struct I8;

impl Format for F32 {
    type Activation = f32;
    type Weight = f32;
    type Sum = f32;
    const LOWEST: f32 = f32::NEG_INFINITY;

    #[inline]
    fn gemm(kernels: &Kernels) -> Option<&Gemm<f32, f32, f32>> {
        Some(&kernels.f32)
    }

    #[inline]
    fn narrow(_: &Kernels, values: &[f32], _: f32, out: &mut [f32]) -> u64 {
        out.copy_from_slice(values);
        0
    }

    #[inline]
    fn as_f32<'a>(
        activations: &'a [f32],
        maxima: &'a mut [f32],
    ) -> Option<(&'a [f32], &'a mut [f32])> {
        Some((activations, maxima))
    }
}

impl Format for I8 {
    type Activation = u8;
    type Weight = i8;
    type Sum = i32;
    const LOWEST: i32 = i32::MIN;
    const GROUP: usize = 4;
    const SIGNED: bool = false;

    #[inline]
    fn gemm(kernels: &Kernels) -> Option<&Gemm<u8, i8, i32>> {
        kernels.i8.as_ref()
    }

    #[inline]
    fn narrow(kernels: &Kernels, values: &[f32], range: f32, out: &mut [u8]) -> u64 {
        let per_unit = f32::from(I8_LARGEST) / range;
        (kernels.narrow_i8)(values, per_unit, out)
    }
}
