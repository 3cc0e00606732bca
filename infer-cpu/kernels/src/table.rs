//! The table of functions that each instruction set fills.

use std::ops::Range;

use crate::edge_conv::{EdgeConv, EdgeScratch};
use crate::neighbor_pool::{NeighborPool, PoolStep};
use crate::neighborhood::Neighborhood;
use crate::panels::Panels;
use crate::rows::Rows;

/// Declares the kernels of one file together with the tests that compare them with the reference,
/// so that no kernel is untested. `runs_here` says whether this machine has the instructions.
macro_rules! declare_kernels {
    ($name:ident, runs_here: $runs_here:expr, $kernels:tt) => {
        static KERNELS: $crate::table::Kernels =
            $crate::table::declare_kernels!(@table $name $kernels);

        /// These kernels, if this machine has their instructions.
        pub(crate) fn kernels() -> Option<&'static $crate::table::Kernels> {
            $runs_here.then_some(&KERNELS)
        }

        #[cfg(test)]
        mod suite {
            $crate::suite::suite!(super::kernels);
        }
    };
    (@table $name:ident { $($field:tt)* }) => {
        $crate::table::Kernels { name: $crate::table::KernelName::$name, $($field)* }
    };
}
pub(crate) use declare_kernels;

/// Multiplies `rows` by a range of panels, applies the panels' scale, bias and ReLU, and writes to
/// rows of `out` that are `out_stride` apart. The column is the number of the channel.
pub type RowsKernel<A, W> =
    fn(&Rows<'_, A>, &Panels<W>, Range<usize>, out: &mut [f32], out_stride: usize);

/// Raises `maxima`, one for each channel of the range, to the largest accumulator over the rows,
/// before scale and bias. NaN does not count.
pub type MaxKernel<A, W, C> = fn(&Rows<'_, A>, &Panels<W>, Range<usize>, maxima: &mut [C]);

/// Does the same, and writes the row (counted from `first_row`) that attains a raised maximum to
/// `winners`. If rows are equal, the first wins.
pub type ArgmaxKernel<A, W, C> = fn(
    &Rows<'_, A>,
    &Panels<W>,
    Range<usize>,
    first_row: u32,
    maxima: &mut [C],
    winners: &mut [u32],
);

/// A sum of products.
pub trait Sum: Copy + PartialOrd + Send + Sync {
    /// Rounds to f32, before scale and bias.
    fn to_f32(self) -> f32;
}

impl Sum for f32 {
    #[inline]
    fn to_f32(self) -> f32 {
        self
    }
}

impl Sum for i32 {
    #[inline]
    fn to_f32(self) -> f32 {
        self as f32
    }
}

/// Matrix products of one number format: activations `A`, weights `W`, accumulators `C`.
pub struct Gemm<A, W, C> {
    /// Output channels of a panel; divides [`WIDTH_STEP`](crate::WIDTH_STEP).
    pub nr: usize,
    /// The inputs of panels are padded to a multiple of this; divides [`WIDTH_STEP`](crate::WIDTH_STEP).
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
pub type Gemv<W> = fn(nonzero: &[(u32, f32)], &Panels<W>, Range<usize>, out: &mut [f32]);

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

/// The kernels of the int8 prefilter. Rows are whole vectors: multiples of [`WIDTH_STEP`](crate::WIDTH_STEP).
pub(crate) struct PrefilterKernels {
    /// Rounds `value * per_unit` to levels, clipped to 0..=[`I8_LARGEST`](crate::I8_LARGEST).
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
/// a multiple of [`WIDTH_STEP`](crate::WIDTH_STEP). The rounding of one product does not depend on the others.
pub(crate) type Dots =
    fn(rows: &Rows<'_, f32>, weights: &[f32], candidates: &[Candidate], out: &mut [f32]);

/// [`EdgeConv::features`].
pub type EdgeFeatures = fn(&EdgeConv, rows: (&mut [f32], usize), &Neighborhood, &mut EdgeScratch);

/// [`NeighborPool::run`].
pub type PoolNeighbors = fn(&NeighborPool, PoolStep<'_>);

/// The coordinates of a cloud as one array per axis, for sampling.
#[derive(Clone, Copy)]
pub struct Soa<'a> {
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
    /// fp32 activations and weights.
    pub f32: Gemm<f32, f32, f32>,
    /// Unsigned seven-bit activations, int8 weights.
    pub i8: Option<Gemm<u8, i8, i32>>,
    /// Whether int8 products are so much faster than fp32 ones that the prefilter pays.
    pub(crate) prefilters: bool,
    pub(crate) prefilter: PrefilterKernels,
    /// fp32 weights.
    pub gemv_f32: Gemv<f32>,
    /// int8 weights, fp32 arithmetic.
    pub gemv_i8: Gemv<i8>,
    /// Rounds `value * per_unit` to 0..=[`I8_LARGEST`](crate::I8_LARGEST) and returns the number of values that were
    /// clipped at the top.
    pub narrow_i8: fn(&[f32], per_unit: f32, &mut [u8]) -> u64,
    /// One step of farthest point sampling: lowers `distance` (squared, per point) to that from
    /// `pick` and returns the first of the farthest points. Squares are summed as `(dx² + dy²) +
    /// dz²`, with each step rounded as in NumPy.
    pub fps_step: fn(Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize,
    /// [`EdgeConv::features`].
    pub edge_features: EdgeFeatures,
    /// [`NeighborPool::run`].
    pub pool_neighbors: PoolNeighbors,
}

formats::named! {
    /// An instruction set that kernels are written for.
    #[non_exhaustive]
    pub enum KernelName: "kernel" {
        /// Plain Rust, everywhere.
        Scalar = "scalar",
        /// AVX2 with FMA.
        Avx2 = "avx2",
        /// AVX-512 F, BW, VL, and VNNI for int8.
        Avx512 = "avx512",
        /// Armv8 NEON, fp32.
        Neon = "neon",
        /// NEON with FEAT_DotProd.
        NeonDot = "neon_dot",
        /// WebAssembly with vectors of 128 bits.
        Simd128 = "simd128",
    }
}
