//! The hot loops, written by hand for each instruction set, behind a table of functions that is
//! chosen at run time.
//!
//! A layer multiplies rows of activations (one row per point) by a matrix that is packed into
//! `Panels` (a few output channels each). A register tile is a few rows by one panel: vector lanes
//! run along output channels, so that rows need no packing and the maximum over points is taken
//! lane by lane. `suite` tests every file against the reference, `scalar`.
//!
//! Kernels do not change the processor's mode for subnormal numbers. Flushing them to 0 changes a
//! sum of K products by at most K times 1.2e-38 (the least normal f32), which is negligible beside
//! activations that decide a class. Logits agree to 1e-33 in both modes, and to the bit in the same
//! mode; `flushed` tests it.

#![expect(unsafe_code, reason = "SIMD intrinsics; every block says why it is sound")]

use std::ops::Range;

use half::f16;

#[doc(hidden)]
pub use crate::edge_conv::Neighborhood;
use crate::edge_conv::{EdgeConv, EdgeScratch};
use crate::set_abstraction::{NeighborPool, PoolStep};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(all(test, not(windows), any(target_arch = "x86_64", target_arch = "aarch64")))]
mod flushed;
#[cfg(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128")))]
mod loops;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(target_arch = "aarch64")]
mod neon_dot;
#[cfg(target_arch = "aarch64")]
mod neon_f16;
mod panels;
mod pooled;
mod scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
#[cfg(test)]
pub(crate) mod suite;

/// Declares the kernels of one file together with the tests that compare them with the reference,
/// so that no kernel is untested. `runs_here` says whether this machine has the instructions.
macro_rules! declare_kernels {
    ($name:ident, runs_here: $runs_here:expr, $kernels:tt) => {
        static KERNELS: $crate::kernel::Kernels =
            $crate::kernel::declare_kernels!(@table $name $kernels);

        /// These kernels, if this machine has their instructions.
        pub(super) fn kernels() -> Option<&'static $crate::kernel::Kernels> {
            $runs_here.then_some(&KERNELS)
        }

        #[cfg(test)]
        mod suite {
            $crate::kernel::suite::suite!(super::kernels);
        }
    };
    (@table $name:ident { $($field:tt)* }) => {
        $crate::kernel::Kernels { name: $crate::kernel::KernelName::$name, $($field)* }
    };
}
use declare_kernels;

pub(crate) use panels::Panels;
#[doc(hidden)]
pub use pooled::PooledProducts;

/// Output channels are padded to a multiple of this, so that a layer's outputs are whole vectors of
/// every kernel in the next layer.
#[doc(hidden)]
pub const WIDTH_STEP: usize = 64;

/// Output channels of a panel for [`Gemv`]: 16 NEON registers of fp32.
pub(crate) const GEMV_NR: usize = 64;

/// The largest activation of an int8 layer: with seven bits, kernels for signed and for unsigned
/// activations accept the same bytes.
pub(crate) const I8_LARGEST: u8 = 127;

/// Activations of `n` points: rows that are `stride` apart; the last one may be shorter.
///
/// # Invariant
/// Every row begins within the data: `(n - 1) * stride` does not exceed its length. [`Rows::new`]
/// checks it and the fields are private, so that [`Rows::check`] cannot wrap.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a, T> {
    data: &'a [T],
    stride: usize,
    n: usize,
}

impl<'a, T> Rows<'a, T> {
    /// `n` rows of `data`, `stride` apart.
    ///
    /// # Panics
    /// If a row begins beyond the data.
    pub fn new(data: &'a [T], stride: usize, n: usize) -> Self {
        assert!(holds_rows(data.len(), n, stride, 0), "rows begin beyond their data");
        Self { data, stride, n }
    }

    pub fn data(&self) -> &'a [T] {
        self.data
    }

    /// The distance from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    pub fn n(&self) -> usize {
        self.n
    }

    /// Asserts that every row has `k` elements, which unsafe kernels rely on.
    fn check(&self, k: usize) {
        assert!(holds_rows(self.data.len(), self.n, self.stride, k), "rows end before their width");
    }
}

/// Whether `len` elements hold `n` rows of `width`, `stride` apart.
fn holds_rows(len: usize, n: usize, stride: usize, width: usize) -> bool {
    let Some(before_last) = n.checked_sub(1) else { return true };
    // A product that wraps would pass the comparison.
    let end = before_last.checked_mul(stride).and_then(|last| last.checked_add(width));
    width <= stride && end.is_some_and(|end| end <= len)
}

/// Multiplies `rows` by a range of panels, applies the panels' scale, bias and ReLU, and writes to
/// rows of `out` that are `out_stride` apart. The column is the number of the channel.
pub(crate) type RowsKernel<A, W> =
    fn(&Rows<'_, A>, &Panels<W>, Range<usize>, out: &mut [f32], out_stride: usize);

/// Raises `maxima`, one for each channel of the range, to the largest accumulator over the rows,
/// before scale and bias. NaN does not count.
pub(crate) type MaxKernel<A, W, C> = fn(&Rows<'_, A>, &Panels<W>, Range<usize>, maxima: &mut [C]);

/// Does the same, and writes the row (counted from `first_row`) that attains a raised maximum to
/// `winners`. If rows are equal, the first wins.
pub(crate) type ArgmaxKernel<A, W, C> = fn(
    &Rows<'_, A>,
    &Panels<W>,
    Range<usize>,
    first_row: u32,
    maxima: &mut [C],
    winners: &mut [u32],
);

/// A sum of products.
pub(crate) trait Sum: Copy + PartialOrd + Send + Sync {
    /// Rounds to f32, before scale and bias.
    fn to_f32(self) -> f32;
}

impl Sum for f32 {
    fn to_f32(self) -> f32 {
        self
    }
}

impl Sum for i32 {
    fn to_f32(self) -> f32 {
        self as f32
    }
}

/// Matrix products of one number format: activations `A`, weights `W`, accumulators `C`.
pub(crate) struct Gemm<A, W, C> {
    /// Output channels of a panel; divides [`WIDTH_STEP`].
    pub nr: usize,
    /// The inputs of panels are padded to a multiple of this; divides [`WIDTH_STEP`].
    pub k_step: usize,
    /// Products that are stored.
    pub rows: RowsKernel<A, W>,
    /// Products that are pooled.
    pub max: MaxKernel<A, W, C>,
    /// Products that are pooled, with the winning rows.
    pub argmax: ArgmaxKernel<A, W, C>,
}

/// Multiplies a sparse vector by a matrix of weights stored as `W`, in f32 arithmetic.
/// [`Panels::columns`] packs the matrix: within a panel, a zero input skips a contiguous block of
/// memory.
///
/// `nonzero` holds (input, value) in the order of inputs; other inputs are 0 and their columns are
/// not read. Writes the products of a range of panels, with scale and bias, to `out`.
pub(crate) type Gemv<W> = fn(nonzero: &[(u32, f32)], &Panels<W>, Range<usize>, out: &mut [f32]);

/// Sums over a row that was quantised to levels, in units of levels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LevelSums {
    /// The sum of the squared rounding errors.
    pub lost: f32,
    /// The sum of the squares of the levels.
    pub squares: f32,
}

/// A product that a prefilter could not rule out as the largest of its channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Candidate {
    pub row: u16,
    pub channel: u16,
}

/// The kernels of the int8 prefilter. Rows are whole vectors: multiples of [`WIDTH_STEP`].
pub(crate) struct PrefilterKernels {
    /// Rounds `value * per_unit` to levels, clipped to 0..=[`I8_LARGEST`].
    pub levels: fn(&[f32], per_unit: f32, out: &mut [u8]) -> LevelSums,
    /// Finds each column's largest value and the first row that has it. No value may be NaN.
    pub peaks: fn(values: &[f32], peaks: &mut [f32], rows: &mut [u32]),
    pub above_floors: AboveFloors,
    pub dots: Dots,
}

/// Writes every value above the floor of its column to `found`, row by row. Returns their number,
/// or `None` if there is no room for them.
pub(crate) type AboveFloors =
    fn(values: &[f32], floors: &[f32], found: &mut [Candidate]) -> Option<usize>;

/// Computes the products of `candidates`. `weights` has `rows.stride()` elements for each channel,
/// a multiple of [`WIDTH_STEP`]. The rounding of one product does not depend on the others.
pub(crate) type Dots =
    fn(rows: &Rows<'_, f32>, weights: &[f32], candidates: &[Candidate], out: &mut [f32]);

/// [`EdgeConv::features`].
pub(crate) type EdgeFeatures =
    fn(&EdgeConv, rows: (&mut [f32], usize), &Neighborhood, &mut EdgeScratch);

/// [`NeighborPool::run`].
pub(crate) type PoolNeighbors = fn(&NeighborPool, PoolStep<'_>);

/// The coordinates of a cloud as one array per axis, for sampling.
#[derive(Clone, Copy)]
pub(crate) struct Soa<'a> {
    /// Coordinates along x.
    pub x: &'a [f32],
    /// As many along y.
    pub y: &'a [f32],
    /// As many along z.
    pub z: &'a [f32],
}

/// The kernels of one instruction set.
pub struct Kernels {
    /// The instruction set.
    pub name: KernelName,
    pub(crate) f32: Option<Gemm<f32, f32, f32>>,
    /// fp16 activations and weights.
    pub(crate) f16: Option<Gemm<f16, f16, f32>>,
    /// Unsigned seven-bit activations, int8 weights.
    pub(crate) i8: Option<Gemm<u8, i8, i32>>,
    /// Whether int8 products are so much faster than fp32 ones that the prefilter pays.
    pub(crate) prefilters: bool,
    pub(crate) prefilter: PrefilterKernels,
    pub(crate) gemv_f32: Gemv<f32>,
    /// fp16 weights, fp32 arithmetic.
    pub(crate) gemv_f16: Gemv<f16>,
    /// int8 weights, fp32 arithmetic.
    pub(crate) gemv_i8: Gemv<i8>,
    /// Rounds to fp16 and returns the largest magnitude before rounding.
    pub(crate) narrow_f16: fn(&[f32], &mut [f16]) -> f32,
    /// Rounds `value * per_unit` to 0..=[`I8_LARGEST`] and returns the number of values that were
    /// clipped at the top.
    pub(crate) narrow_i8: fn(&[f32], per_unit: f32, &mut [u8]) -> u64,
    /// One step of farthest point sampling: lowers `distance` (squared, per point) to that from
    /// `pick` and returns the first of the farthest points. Squares are summed as `(dx² + dy²) +
    /// dz²`, with each step rounded as in NumPy.
    pub(crate) fps_step: fn(Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize,
    /// [`EdgeConv::features`].
    pub(crate) edge_features: EdgeFeatures,
    /// [`NeighborPool::run`].
    pub(crate) pool_neighbors: PoolNeighbors,
}

formats::named! {
    /// An instruction set that kernels are written for.
    #[non_exhaustive]
    pub enum KernelName: "kernel" {
        /// Plain Rust, everywhere.
        Scalar = "scalar",
        /// AVX2 with FMA and F16C.
        Avx2 = "avx2",
        /// AVX-512 F, BW, VL, and VNNI for int8.
        Avx512 = "avx512",
        /// Armv8 NEON, fp32.
        Neon = "neon",
        /// NEON with FEAT_FP16.
        NeonF16 = "neon_f16",
        /// NEON with FEAT_DotProd.
        NeonDot = "neon_dot",
        /// WebAssembly with vectors of 128 bits.
        Simd128 = "simd128",
    }
}

impl KernelName {
    /// Its kernels, if this machine can run them.
    #[must_use]
    pub fn kernels(self) -> Option<&'static Kernels> {
        match self {
            Self::Scalar => scalar::kernels(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::kernels(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::kernels(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => neon::kernels(),
            #[cfg(target_arch = "aarch64")]
            Self::NeonF16 => neon_f16::kernels(),
            #[cfg(target_arch = "aarch64")]
            Self::NeonDot => neon_dot::kernels(),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => simd128::kernels(),
            #[allow(unreachable_patterns, reason = "each architecture leaves others out")]
            _ => None,
        }
    }
}

/// All kernels that this machine can run, the fastest first.
pub fn available() -> impl Iterator<Item = &'static Kernels> {
    // Names are in the order of speed on each architecture.
    KernelName::ALL.into_iter().rev().filter_map(KernelName::kernels)
}

/// The fastest kernels that this machine can run.
#[must_use]
pub fn fastest() -> &'static Kernels {
    available().next().expect("invariant: the scalar kernels run everywhere")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_no_data_holds_are_refused_instead_of_wrapped() {
        // Two strides of 2^63 are 2^64, which wraps to 0.
        let half = usize::MAX / 2 + 1;
        suite::panics_with("rows begin beyond", || Rows::new(&[0.0f32; 4], half, 3));
        suite::panics_with("rows begin beyond", || Rows::new(&[0.0f32; 4], 5, 2));
        let rows = Rows::new(&[0.0f32; 4], 2, 2);
        rows.check(2);
        suite::panics_with("rows end before", || rows.check(3));
        suite::panics_with("rows end before", || rows.check(usize::MAX));
        Rows::new(&[0.0f32; 0], 0, 0).check(usize::MAX);
    }
}
