//! What AVX2 and AVX-512 kernels share: the same loops over vectors of another
//! length. Everything here is inlined into functions that enable the
//! instructions, in [`super::avx2`] and [`super::avx512`].

mod lanes;
mod products;
mod tile;
mod vectors;

pub(super) use lanes::{Lanes, Weight, implement_lanes};
pub(super) use products::{argmax, max, rows};
pub(super) use tile::{Byte, Half, Single};
pub(super) use vectors::{
    above_floors, dots, fps_step, gemv, levels, narrow_f16, narrow_i8, peaks,
};

/// Vectors of channels in a tile.
const V: usize = 2;

/// The safe functions of a table of kernels over vectors `$lanes`, whose
/// blocks of columns take `$b` vectors.
///
/// They enable `$features` without looking: the table that holds them is
/// given out only where the machine has been found to have them.
macro_rules! entries {
    ($lanes:ty, $b:literal, $features:literal) => {
        use $crate::kernel::x86::{self, Byte, Half, Single};
        use $crate::kernel::{Candidate, Columns, LevelSums, Panels, Rows, Soa};

        $crate::kernel::x86::entries!(@gemm $lanes, $features, Single, f32, f32, f32,
            f32_rows, f32_max, f32_argmax);
        $crate::kernel::x86::entries!(@gemm $lanes, $features, Half, f16, f16, f32,
            f16_rows, f16_max, f16_argmax);
        $crate::kernel::x86::entries!(@gemm $lanes, $features, Byte, u8, i8, i32,
            i8_rows, i8_max, i8_argmax);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, f32, gemv_f32);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, f16, gemv_f16);
        $crate::kernel::x86::entries!(@gemv $lanes, $features, $b, i8, gemv_i8);

        fn narrow_f16(values: &[f32], out: &mut [f16]) -> f32 {
            #[target_feature(enable = $features)]
            unsafe fn run(values: &[f32], out: &mut [f16]) -> (usize, f32) {
                // SAFETY: `run` enables the features.
                unsafe { x86::narrow_f16::<$lanes>(values, out) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            let (whole, largest) = unsafe { run(values, out) };
            largest.max($crate::kernel::scalar::narrow_f16(&values[whole..], &mut out[whole..]))
        }

        fn narrow_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
            #[target_feature(enable = $features)]
            unsafe fn run(values: &[f32], per_unit: f32, out: &mut [u8]) -> (usize, u64) {
                // SAFETY: `run` enables the features.
                unsafe { x86::narrow_i8::<$lanes>(values, per_unit, out) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            let (whole, clipped) = unsafe { run(values, per_unit, out) };
            let (values, out) = (&values[whole..], &mut out[whole..]);
            clipped + $crate::kernel::scalar::narrow_i8(values, per_unit, out)
        }

        fn levels(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums {
            #[target_feature(enable = $features)]
            unsafe fn run(row: &[f32], per_unit: f32, out: &mut [u8]) -> LevelSums {
                // SAFETY: `run` enables the features.
                unsafe { x86::levels::<$lanes>(row, per_unit, out) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(row, per_unit, out) }
        }

        fn peaks(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) {
            #[target_feature(enable = $features)]
            unsafe fn run(values: &[f32], peaks: &mut [f32], rows: &mut [u32]) {
                // SAFETY: `run` enables the features.
                unsafe { x86::peaks::<$lanes>(values, peaks, rows) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(values, peaks, rows) }
        }

        fn above_floors(values: &[f32], floors: &[f32], found: &mut [Candidate]) -> Option<usize> {
            #[target_feature(enable = $features)]
            unsafe fn run(
                values: &[f32],
                floors: &[f32],
                found: &mut [Candidate],
            ) -> Option<usize> {
                // SAFETY: `run` enables the features.
                unsafe { x86::above_floors::<$lanes>(values, floors, found) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(values, floors, found) }
        }

        fn dots(
            rows: &Rows<'_, f32>,
            weights: &[f32],
            candidates: &[Candidate],
            out: &mut [f32],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, f32>,
                weights: &[f32],
                candidates: &[Candidate],
                out: &mut [f32],
            ) {
                // SAFETY: `run` enables the features.
                unsafe { x86::dots::<$lanes>(rows, weights, candidates, out) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(rows, weights, candidates, out) }
        }

        fn fps_step(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
            #[target_feature(enable = $features)]
            unsafe fn run(cloud: Soa<'_>, pick: [f32; 3], distance: &mut [f32]) -> usize {
                // SAFETY: `run` enables the features.
                unsafe { x86::fps_step::<$lanes>(cloud, pick, distance) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(cloud, pick, distance) }
        }
    };
    (@gemm $lanes:ty, $features:literal, $tile:ty, $a:ty, $w:ty, $c:ty,
     $rows:ident, $max:ident, $argmax:ident) => {
        fn $rows(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            out: &mut [f32],
            stride: usize,
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                out: &mut [f32],
                stride: usize,
            ) {
                // SAFETY: `run` enables the features.
                unsafe { x86::rows::<$lanes, $tile>(rows, weights, panels, out, stride) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(rows, weights, panels, out, stride) }
        }

        fn $max(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            maxima: &mut [$c],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                maxima: &mut [$c],
            ) {
                // SAFETY: `run` enables the features.
                unsafe { x86::max::<$lanes, $tile>(rows, weights, panels, maxima) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(rows, weights, panels, maxima) }
        }

        fn $argmax(
            rows: &Rows<'_, $a>,
            weights: &Panels<$w>,
            panels: Range<usize>,
            first_row: u32,
            maxima: &mut [$c],
            winners: &mut [u32],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                rows: &Rows<'_, $a>,
                weights: &Panels<$w>,
                panels: Range<usize>,
                first_row: u32,
                maxima: &mut [$c],
                winners: &mut [u32],
            ) {
                // SAFETY: `run` enables the features.
                unsafe {
                    x86::argmax::<$lanes, $tile>(
                        rows, weights, panels, first_row, maxima, winners,
                    );
                }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(rows, weights, panels, first_row, maxima, winners) }
        }
    };
    (@gemv $lanes:ty, $features:literal, $b:literal, $w:ty, $gemv:ident) => {
        fn $gemv(
            nonzero: &[(u32, f32)],
            weights: &Columns<$w>,
            blocks: Range<usize>,
            out: &mut [f32],
        ) {
            #[target_feature(enable = $features)]
            unsafe fn run(
                nonzero: &[(u32, f32)],
                weights: &Columns<$w>,
                blocks: Range<usize>,
                out: &mut [f32],
            ) {
                // SAFETY: `run` enables the features.
                unsafe { x86::gemv::<$lanes, $w, $b>(nonzero, weights, blocks, out) }
            }
            // SAFETY: `kernels()` gives out the table of these functions where the
            // machine was found to have the features.
            unsafe { run(nonzero, weights, blocks, out) }
        }
    };
}
pub(super) use entries;
