//! The loops of the AVX2, AVX-512 and WebAssembly kernels, generic over the vector. Everything here is
//! inlined into functions that enable the instructions, in `avx2`, `avx512` and `simd128`.

mod lanes;
mod products;
mod tile;
mod vectors;

pub(super) use lanes::{Lanes, Vector, Weight, implement};
pub(super) use products::{argmax, max, rows};
pub(super) use tile::{Byte, Single, Tile};
pub(super) use vectors::{above_floors, dots, fps_step, gemv, levels, narrow_i8, peaks};

/// Vectors of channels in a tile.
pub(super) const V: usize = 2;

/// Declares the kernels `$name` over vectors `$lanes`.
macro_rules! declare {
    (
        $name:ident, $lanes:ty, $features:literal,
        runs_here: $runs_here:expr, fused: $fused:literal, prefilters: $prefilters:literal
    ) => {
        use std::ops::Range;

        use $crate::edge_conv::{EdgeConv, EdgeScratch};
        use $crate::loops::{self, Byte, Single, Tile, Weight};
        use $crate::neighbor_pool::{NeighborPool, PoolStep};
        use $crate::neighborhood::Neighborhood;
        use $crate::table::{Candidate, Gemm, LevelSums, PrefilterKernels, Soa};
        use $crate::{GEMV_NR, Panels, Rows};

        $crate::table::declare_kernels!($name, runs_here: $runs_here, {
            f32: gemm::<Single>(),
            i8: Some(gemm::<Byte>()),
            prefilters: $prefilters,
            prefilter: PrefilterKernels { levels, peaks, above_floors, dots },
            gemv_f32: gemv::<f32>,
            gemv_i8: gemv::<i8>,
            narrow_i8,
            fps_step,
            edge_features,
            pool_neighbors,
        });

        const fn gemm<T: Tile<$lanes>>()
        -> Gemm<T::Activation, T::Weight, <T::Sums as loops::Vector>::Element> {
            Gemm {
                nr: loops::V * <$lanes as loops::Lanes>::N,
                k_step: T::STEP,
                rows: rows::<T>,
                max: max::<T>,
                argmax: argmax::<T>,
            }
        }

        $crate::loops::enable! { $features;
            fn rows<T: Tile<$lanes>>(
                rows: &Rows<'_, T::Activation>,
                weights: &Panels<T::Weight>,
                panels: Range<usize>,
                out: &mut [f32],
                stride: usize,
            ) = loops::rows::<$lanes, T>;

            fn max<T: Tile<$lanes>>(
                rows: &Rows<'_, T::Activation>,
                weights: &Panels<T::Weight>,
                panels: Range<usize>,
                maxima: &mut [<T::Sums as loops::Vector>::Element],
            ) = loops::max::<$lanes, T>;

            fn argmax<T: Tile<$lanes>>(
                rows: &Rows<'_, T::Activation>,
                weights: &Panels<T::Weight>,
                panels: Range<usize>,
                first_row: u32,
                maxima: &mut [<T::Sums as loops::Vector>::Element],
                winners: &mut [u32],
            ) = loops::argmax::<$lanes, T>;

            fn gemv<W: Weight>(
                nonzero: &[(u32, f32)],
                weights: &Panels<W>,
                panels: Range<usize>,
                out: &mut [f32],
            ) = loops::gemv::<$lanes, W, { GEMV_NR / <$lanes as loops::Lanes>::N }>;

            fn narrow_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 =
                loops::narrow_i8::<$lanes>;

            fn levels(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums =
                loops::levels::<$lanes>;

            fn peaks(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) = loops::peaks::<$lanes>;

            fn above_floors(
                values: &[f32],
                floors: &[f32],
                found: &mut [Candidate],
            ) -> Option<usize> = loops::above_floors::<$lanes>;

            fn dots(
                rows: &Rows<'_, f32>,
                weights: &[f32],
                candidates: &[Candidate],
                out: &mut [f32],
            ) = loops::dots::<$lanes>;

            fn fps_step(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize =
                loops::fps_step::<$lanes>;

            fn edge_features(
                edges: &EdgeConv,
                rows: (&mut [f32], usize),
                cloud: &Neighborhood,
                scratch: &mut EdgeScratch,
            ) = EdgeConv::features::<$fused>;

            fn pool_neighbors(pool: &NeighborPool, step: PoolStep<'_>) =
                NeighborPool::run::<$fused>;
        }
    };
}
pub(super) use declare;

/// Defines a safe function for each loop, compiled with `$features`.
///
/// It does not check for the features: `kernels()` gives out the table only where the machine has
/// them.
macro_rules! enable {
    ($features:literal; $(
        fn $name:ident $(<$t:ident: $bound:path>)? (
            $($argument:ident: $type:ty),* $(,)?
        ) $(-> $out:ty)? = $call:expr;
    )*) => {$(
        fn $name $(<$t: $bound>)? ($($argument: $type),*) $(-> $out)? {
            #[target_feature(enable = $features)]
            #[allow(unused_unsafe, reason = "the loops of features are safe")]
            unsafe fn run $(<$t: $bound>)? ($($argument: $type),*) $(-> $out)? {
                // SAFETY: `run` enables the features; the loops check their operands.
                unsafe { $call($($argument),*) }
            }
            // SAFETY: `kernels()` gives out the table of these functions only where the machine has
            // the features.
            unsafe { run $(::<$t>)? ($($argument),*) }
        }
    )*};
}
pub(super) use enable;
