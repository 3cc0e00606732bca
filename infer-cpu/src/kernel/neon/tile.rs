//! Matrix products by register tiles: what is the same in every number format.

use std::arch::aarch64::uint32x4_t;
use std::arch::asm;
use std::array::from_fn;
use std::ops::Range;

use super::super::{Gemm, Panels, Rows};
use super::lanes::{Lanes, Sums};
use super::sink::{ArgMax, Finish, Max, Sink};

/// Rows of the tallest tile.
const TALLEST: usize = 8;

/// Where the operands of one tile are.
pub struct Operands<A, W> {
    /// The first activation of its first row.
    pub rows: *const A,
    /// From one row to the next.
    pub stride: usize,
    /// The weights of its panel.
    pub weights: *const W,
    /// Inputs with padding.
    pub inputs: usize,
}

impl<A, W> Operands<A, W> {
    /// Input `k` of each of `R` rows.
    ///
    /// A compiler that knows that rows are a stride apart goes from one to the
    /// next by additions in the inner loop; an empty instruction hides it.
    #[inline(always)]
    pub fn row_pointers<const R: usize>(&self, k: usize) -> [*const A; R] {
        from_fn(|r| {
            let mut row = self.rows.wrapping_add(r * self.stride + k);
            // SAFETY: no instruction.
            unsafe {
                asm!("/* {0} */", inout(reg) row, options(pure, nomem, nostack, preserves_flags));
            }
            row
        })
    }
}

/// Where a tile is in the product.
#[derive(Clone, Copy)]
pub struct Place {
    /// Its first row.
    pub row: usize,
    /// Its panel.
    pub panel: usize,
}

/// A register tile of `V` vectors of four sums by up to [`TALLEST`] rows.
pub trait Tile<const V: usize> {
    /// What rows hold.
    type Activation;
    /// What panels hold.
    type Weight: Copy + Default;
    /// A vector of sums.
    type Sums: Sums;
    /// Inputs of one round of its loop.
    const STEP: usize;

    /// The products of `R` rows and one panel. The order in which a sum is
    /// formed does not depend on `R`.
    ///
    /// # Safety
    /// The machine has the tile's instructions; `inputs` is a multiple of
    /// `STEP`; there are so many activations in each of `R` rows, and `4 * V`
    /// times as many weights.
    unsafe fn sums<const R: usize>(
        operands: &Operands<Self::Activation, Self::Weight>,
    ) -> [[Self::Sums; V]; R];

    /// The largest of each channel's sums, [`Sums::LOWEST`] of none but NaN.
    ///
    /// # Safety
    /// As [`Tile::sums`].
    #[inline(always)]
    unsafe fn largest<const R: usize>(
        operands: &Operands<Self::Activation, Self::Weight>,
    ) -> [Self::Sums; V] {
        // SAFETY: the caller's.
        largest(unsafe { Self::sums::<R>(operands) })
    }

    /// The largest of each channel's sums, and the first of its rows, counted
    /// from the tile's first.
    ///
    /// # Safety
    /// As [`Tile::sums`].
    #[inline(always)]
    unsafe fn first_largest<const R: usize>(
        operands: &Operands<Self::Activation, Self::Weight>,
    ) -> ([Self::Sums; V], [uint32x4_t; V]) {
        // SAFETY: the caller's.
        first_largest(unsafe { Self::sums::<R>(operands) })
    }
}

/// The largest sum of each column.
#[inline(always)]
pub fn largest<S: Sums, const V: usize, const R: usize>(sums: [[S; V]; R]) -> [S; V] {
    let lowest = [S::splat(S::LOWEST); V];
    sums.iter().fold(lowest, |largest, sums| from_fn(|v| largest[v].larger(sums[v])))
}

/// The largest sum of each column, and the first of its rows.
#[inline(always)]
pub fn first_largest<S: Sums, const V: usize, const R: usize>(
    sums: [[S; V]; R],
) -> ([S; V], [uint32x4_t; V]) {
    let mut largest = [S::splat(S::LOWEST); V];
    let mut rows = [uint32x4_t::splat(0); V];
    for (row, sums) in (0..).map(uint32x4_t::splat).zip(&sums) {
        for v in 0..V {
            let raised = sums[v].exceeds(largest[v]);
            largest[v] = largest[v].replaced(raised, sums[v]);
            rows[v] = rows[v].replaced(raised, row);
        }
    }
    (largest, rows)
}

/// A number of the tile's sums.
pub type Sum<T, const V: usize> = <<T as Tile<V>>::Sums as Lanes>::Element;

/// The products of one format.
pub const fn gemm<T: Tile<V>, const V: usize>() -> Gemm<T::Activation, T::Weight, Sum<T, V>> {
    Gemm {
        nr: 4 * V,
        k_step: T::STEP,
        rows: rows::<T, V>,
        max: max::<T, V>,
        argmax: argmax::<T, V>,
    }
}

fn rows<T: Tile<V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    for_each_tile::<T, _, V>(rows, weights, panels, Finish::new(weights, out, out_stride));
}

fn max<T: Tile<V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    maxima: &mut [Sum<T, V>],
) {
    let sink = Max { first_panel: panels.start, maxima };
    for_each_tile::<T, _, V>(rows, weights, panels, sink);
}

fn argmax<T: Tile<V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [Sum<T, V>],
    winners: &mut [u32],
) {
    let sink = ArgMax { max: Max { first_panel: panels.start, maxima }, first_row, winners };
    for_each_tile::<T, _, V>(rows, weights, panels, sink);
}

/// Gives `sink` all products of `rows` and some panels, panel by panel, so that
/// a panel stays in the first-level cache while the rows pass.
fn for_each_tile<T: Tile<V>, S: Sink<T, V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    mut sink: S,
) {
    let inputs = weights.padded_inputs;
    rows.check(inputs);
    assert!(
        weights.nr == 4 * V && inputs.is_multiple_of(T::STEP),
        "panels packed for another kernel"
    );
    for panel in panels {
        let weights = weights.panel(panel);
        for row in (0..rows.n).step_by(TALLEST) {
            let place = Place { row, panel };
            let operands = Operands {
                rows: rows.data[row * rows.stride..].as_ptr(),
                stride: rows.stride,
                weights: weights.as_ptr(),
                inputs,
            };
            // SAFETY: `check` and `panel` found the operands whole, the
            // assertion their padding; a table of kernels is only given out
            // where its instructions are.
            unsafe {
                match rows.n - row {
                    1 => sink.take::<1>(&operands, place),
                    2 => sink.take::<2>(&operands, place),
                    3 => sink.take::<3>(&operands, place),
                    4 => sink.take::<4>(&operands, place),
                    5 => sink.take::<5>(&operands, place),
                    6 => sink.take::<6>(&operands, place),
                    7 => sink.take::<7>(&operands, place),
                    _ => sink.take::<TALLEST>(&operands, place),
                }
            }
        }
    }
}
