//! The register tile of R rows and V vectors of output channels, lanes along
//! channels:
//!
//! ```text
//!              w[k, 0..n]   w[k, n..2n]     one panel, V = 2
//! a[0, k]  ->    acc 0,0      acc 0,1       a is splat from memory,
//! a[1, k]  ->    acc 1,0      acc 1,1       row-major, unpacked
//!   ...
//! ```

use half::f16;

use super::{Lanes, V, Weight};

/// Inputs of fp16 rows that are widened at a time.
const WIDENED: usize = 128;

/// One format's tile of `R` rows.
pub(in crate::kernel) trait Tile<L: Lanes> {
    type Activation: Copy;
    type Weight: Copy + Default;
    type Sum: Copy;
    /// A vector of sums.
    type Sums: Copy;

    /// The sums of `R` rows and one panel.
    ///
    /// # Safety
    /// `R` rows of `panel.len() / nr` activations, `stride` apart, at `rows`.
    unsafe fn sums<const R: usize>(
        rows: *const Self::Activation,
        stride: usize,
        panel: &[Self::Weight],
    ) -> [[Self::Sums; V]; R];
    unsafe fn float(sums: Self::Sums) -> L;
    unsafe fn load(from: *const Self::Sum) -> Self::Sums;
    unsafe fn store(sums: Self::Sums, to: *mut Self::Sum);
    unsafe fn max(sums: Self::Sums, best: Self::Sums) -> Self::Sums;
    unsafe fn keep_greater(
        sums: Self::Sums,
        best: &mut Self::Sums,
        who: &mut L::Int,
        index: L::Int,
    );
}

/// fp32 rows and weights.
pub(in crate::kernel) struct Single;
/// fp16 rows and weights, fp32 arithmetic.
pub(in crate::kernel) struct Half;
/// Byte rows and weights.
pub(in crate::kernel) struct Byte;

#[inline(always)]
unsafe fn accumulate<L: Lanes, W: Weight, const R: usize>(
    acc: &mut [[L; V]; R],
    rows: *const f32,
    stride: usize,
    panel: *const W,
    k: usize,
) {
    for k in 0..k {
        // SAFETY: panel and rows have k inputs, as the caller promises.
        unsafe {
            let w: [L; V] = std::array::from_fn(|v| W::lanes(panel.add((k * V + v) * L::N)));
            for (r, acc) in acc.iter_mut().enumerate() {
                let a = L::splat(*rows.add(r * stride + k));
                for v in 0..V {
                    acc[v] = a.fma(w[v], acc[v]);
                }
            }
        }
    }
}

macro_rules! float_sums {
    ($activation:ty) => {
        type Activation = $activation;
        type Weight = $activation;
        type Sum = f32;
        type Sums = L;

        #[inline(always)]
        unsafe fn float(sums: L) -> L {
            sums
        }

        #[inline(always)]
        unsafe fn load(from: *const f32) -> L {
            // SAFETY: as the caller promises.
            unsafe { L::load(from) }
        }

        #[inline(always)]
        unsafe fn store(sums: L, to: *mut f32) {
            // SAFETY: as the caller promises.
            unsafe { sums.store(to) }
        }

        #[inline(always)]
        unsafe fn max(sums: L, best: L) -> L {
            // SAFETY: as the caller promises.
            unsafe { sums.max(best) }
        }

        #[inline(always)]
        unsafe fn keep_greater(sums: L, best: &mut L, who: &mut L::Int, index: L::Int) {
            // SAFETY: as the caller promises.
            unsafe { sums.keep_greater(best, who, index) }
        }
    };
}

impl<L: Lanes> Tile<L> for Single {
    float_sums!(f32);

    #[inline(always)]
    unsafe fn sums<const R: usize>(rows: *const f32, stride: usize, panel: &[f32]) -> [[L; V]; R] {
        // SAFETY: as the caller promises.
        unsafe {
            let mut acc = [[L::splat(0.0); V]; R];
            accumulate(&mut acc, rows, stride, panel.as_ptr(), panel.len() / (V * L::N));
            acc
        }
    }
}

impl<L: Lanes> Tile<L> for Half {
    float_sums!(f16);

    #[inline(always)]
    unsafe fn sums<const R: usize>(rows: *const f16, stride: usize, panel: &[f16]) -> [[L; V]; R] {
        // SAFETY: as the caller promises; panels' inputs are whole vectors.
        unsafe {
            let mut acc = [[L::splat(0.0); V]; R];
            let mut wide = [[0.0f32; WIDENED]; R];
            for (chunk, panel) in panel.chunks(WIDENED * V * L::N).enumerate() {
                let k = panel.len() / (V * L::N);
                for (r, wide) in wide.iter_mut().enumerate() {
                    let row = rows.add(r * stride + chunk * WIDENED);
                    for at in (0..k).step_by(L::N) {
                        L::load_f16(row.add(at)).store(wide.as_mut_ptr().add(at));
                    }
                }
                accumulate(&mut acc, wide.as_ptr().cast(), WIDENED, panel.as_ptr(), k);
            }
            acc
        }
    }
}

impl<L: Lanes> Tile<L> for Byte {
    type Activation = u8;
    type Weight = i8;
    type Sum = i32;
    type Sums = L::Int;

    #[inline(always)]
    unsafe fn sums<const R: usize>(
        rows: *const u8,
        stride: usize,
        panel: &[i8],
    ) -> [[L::Int; V]; R] {
        // SAFETY: as the caller promises; panels' inputs are whole groups of 4.
        unsafe {
            let mut acc = [[L::splat_int(0); V]; R];
            let panel_start = panel.as_ptr().cast::<i32>();
            for group in 0..panel.len() / (4 * V * L::N) {
                let w: [L::Int; V] =
                    std::array::from_fn(|v| L::load_int(panel_start.add((group * V + v) * L::N)));
                for (r, acc) in acc.iter_mut().enumerate() {
                    let four = rows.add(r * stride + group * 4).cast::<i32>().read_unaligned();
                    let a = L::splat_int(four);
                    for v in 0..V {
                        acc[v] = L::dot4(acc[v], a, w[v]);
                    }
                }
            }
            acc
        }
    }

    #[inline(always)]
    unsafe fn float(sums: L::Int) -> L {
        // SAFETY: as the caller promises.
        unsafe { L::to_float(sums) }
    }

    #[inline(always)]
    unsafe fn load(from: *const i32) -> L::Int {
        // SAFETY: as the caller promises.
        unsafe { L::load_int(from) }
    }

    #[inline(always)]
    unsafe fn store(sums: L::Int, to: *mut i32) {
        // SAFETY: as the caller promises.
        unsafe { L::store_int(sums, to) }
    }

    #[inline(always)]
    unsafe fn max(sums: L::Int, best: L::Int) -> L::Int {
        // SAFETY: as the caller promises.
        unsafe { L::max_int(sums, best) }
    }

    #[inline(always)]
    unsafe fn keep_greater(sums: L::Int, best: &mut L::Int, who: &mut L::Int, index: L::Int) {
        // SAFETY: as the caller promises.
        unsafe { L::keep_greater_int(sums, best, who, index) }
    }
}
