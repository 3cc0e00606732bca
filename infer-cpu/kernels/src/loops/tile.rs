//! The register tile of R rows and V vectors of output channels, lanes along channels:
//!
//! ```text
//!              w[k, 0..n]   w[k, n..2n]     one panel, V = 2
//! a[0, k]  ->    acc 0,0      acc 0,1       a is splat from memory,
//! a[1, k]  ->    acc 1,0      acc 1,1       row-major, unpacked
//!   ...
//! ```

use super::{Lanes, V, Vector};

/// One format's tile of `R` rows.
pub(crate) trait Tile<L: Lanes> {
    type Activation: Copy;
    type Weight: Copy + Default;
    type Sums: Vector<Float = L, Int = L::Int>;
    /// The inputs of one round of the loop; a panel has a multiple of it.
    const STEP: usize;

    /// The sums of `R` rows and one panel.
    ///
    /// # Safety
    /// The instruction set of `L`; at `rows` are `R` rows of `panel.len() / (V * L::N)`
    /// activations, `stride` apart, and that number is a multiple of [`Tile::STEP`].
    unsafe fn sums<const R: usize>(
        rows: *const Self::Activation,
        stride: usize,
        panel: &[Self::Weight],
    ) -> [[Self::Sums; V]; R];
}

/// fp32 rows and weights.
pub(crate) struct Single;
/// Byte rows and weights.
pub(crate) struct Byte;

impl<L: Lanes> Tile<L> for Single {
    type Activation = f32;
    type Weight = f32;
    type Sums = L;
    const STEP: usize = 1;

    #[inline(always)]
    unsafe fn sums<const R: usize>(rows: *const f32, stride: usize, panel: &[f32]) -> [[L; V]; R] {
        // SAFETY: `check` found as many inputs in each row of `Rows` as in the panel.
        unsafe {
            let mut acc = [[L::splat(0.0); V]; R];
            for k in 0..panel.len() / (V * L::N) {
                let w: [L; V] =
                    std::array::from_fn(|v| L::load(panel.as_ptr().add((k * V + v) * L::N)));
                for (r, acc) in acc.iter_mut().enumerate() {
                    // One load broadcasts an activation to all lanes, so that rows need no packing.
                    let a = L::splat(*rows.add(r * stride + k));
                    for v in 0..V {
                        acc[v] = a.fma(w[v], acc[v]);
                    }
                }
            }
            acc
        }
    }
}

impl<L: Lanes> Tile<L> for Byte {
    type Activation = u8;
    type Weight = i8;
    type Sums = L::Int;
    const STEP: usize = 4;

    #[inline(always)]
    unsafe fn sums<const R: usize>(
        rows: *const u8,
        stride: usize,
        panel: &[i8],
    ) -> [[L::Int; V]; R] {
        // SAFETY: `check` found as many inputs in each row of `Rows` as in the panel, and a
        // multiple of STEP, which is a whole group.
        unsafe {
            let mut acc = [[L::Int::splat(0); V]; R];
            let panel_start = panel.as_ptr().cast::<i32>();
            for group in 0..panel.len() / (4 * V * L::N) {
                let w: [L::Int; V] =
                    std::array::from_fn(|v| L::Int::load(panel_start.add((group * V + v) * L::N)));
                for (r, acc) in acc.iter_mut().enumerate() {
                    let four = rows.add(r * stride + group * 4).cast::<i32>().read_unaligned();
                    let a = L::Int::splat(four);
                    for v in 0..V {
                        acc[v] = L::dot4(acc[v], a, w[v]);
                    }
                }
            }
            acc
        }
    }
}
