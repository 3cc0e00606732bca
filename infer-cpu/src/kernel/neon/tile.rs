//! Matrix products by register tiles: what is the same in every number format.

use std::arch::asm;
use std::array::from_fn;
use std::ops::Range;

use super::super::{Gemm, Panels, Rows};
use super::lanes::{Lanes, Sums, load, store};
use super::sink::{ArgMax, Finish, Max};

/// Rows of the tallest tile.
const TALLEST: usize = 8;

/// How far an inner loop goes along rows at a time.
pub const VECTOR_BYTES: usize = 16;

/// A register tile of rows by `V` vectors of four sums, in one number format.
pub trait Tile<const V: usize> {
    /// What rows hold.
    type Activation;
    /// What panels hold.
    type Weight: Copy + Default;
    /// A vector of sums.
    type Sums: Sums;
    /// Inputs of one round of its inner loop.
    const STEP: usize = VECTOR_BYTES / size_of::<Self::Activation>();
}

/// A tile whose sums go to `S`.
pub trait Feed<S, const V: usize>: Tile<V> {
    /// Gives `sink` the products of a strip by tiles of `R` rows. The order in
    /// which a sum is formed does not depend on `R`.
    ///
    /// # Safety
    /// The machine has the tile's instructions, the strip is as it says, and
    /// `sink` has room for its rows.
    unsafe fn feed<const R: usize>(strip: &Strip<Self::Activation, Self::Weight>, sink: &mut S);
}

/// Rows by one panel.
pub struct Strip<A, W> {
    /// The first activation of the first row.
    pub rows: *const A,
    /// From one row to the next.
    pub stride: usize,
    /// How often the rows of a tile are there.
    pub n_tiles: usize,
    /// `4 * V` weights for each input.
    pub weights: *const W,
    /// Inputs of every row, a multiple of the tile's step.
    pub inputs: usize,
}

impl<A, W> Strip<A, W> {
    /// Bytes of a row's inputs.
    #[inline(always)]
    pub fn row_bytes(&self) -> usize {
        self.inputs * size_of::<A>()
    }

    /// The first `R` rows.
    ///
    /// In inner loops an activation is at its row's pointer plus an offset that
    /// all rows share, which costs nothing but the load. A compiler that knew
    /// the rows to be a stride apart would go from one to the next by
    /// additions; an empty instruction hides it.
    #[inline(always)]
    pub fn first_rows<const R: usize>(&self) -> [*const A; R] {
        from_fn(|r| {
            let mut offset = r * self.stride;
            // SAFETY: no instruction.
            unsafe {
                asm!("/* {0} */", inout(reg) offset, options(pure, nomem, nostack, preserves_flags));
            }
            self.rows.wrapping_add(offset)
        })
    }

    /// The `R` rows after `rows`.
    #[inline(always)]
    pub fn next_rows<const R: usize>(&self, rows: [*const A; R]) -> [*const A; R] {
        rows.map(|row| row.wrapping_add(R * self.stride))
    }
}

/// A tile's vector of sums.
type Four<T, const V: usize> = <T as Tile<V>>::Sums;

/// One of them.
type Sum<T, const V: usize> = <Four<T, V> as Lanes>::Element;

/// The products of one format.
pub const fn gemm<T, const V: usize>() -> Gemm<T::Activation, T::Weight, Sum<T, V>>
where
    T: Tile<V> + Feed<Finish<V>, V> + Feed<Max<Four<T, V>, V>, V> + Feed<ArgMax<Four<T, V>, V>, V>,
{
    Gemm {
        nr: 4 * V,
        k_step: T::STEP,
        rows: rows::<T, V>,
        max: max::<T, V>,
        argmax: argmax::<T, V>,
    }
}

fn rows<T: Feed<Finish<V>, V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    for panel in panels {
        let mut sink = Finish::new(weights, panel, rows.n, out, out_stride);
        multiply::<T, _, V>(rows, weights, panel, &mut sink);
    }
}

fn max<T: Tile<V> + Feed<Max<Four<T, V>, V>, V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    maxima: &mut [Sum<T, V>],
) {
    for (panel, maxima) in panels.zip(maxima.chunks_exact_mut(4 * V)) {
        let mut sink = Max { largest: load(maxima) };
        multiply::<T, _, V>(rows, weights, panel, &mut sink);
        store(sink.largest, maxima);
    }
}

fn argmax<T: Tile<V> + Feed<ArgMax<Four<T, V>, V>, V>, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [Sum<T, V>],
    winners: &mut [u32],
) {
    let channels = maxima.chunks_exact_mut(4 * V).zip(winners.chunks_exact_mut(4 * V));
    for (panel, (maxima, winners)) in panels.zip(channels) {
        let mut sink = ArgMax {
            largest: load(maxima),
            winners: load(winners),
            next_row: Lanes::splat(first_row),
        };
        multiply::<T, _, V>(rows, weights, panel, &mut sink);
        store(sink.largest, maxima);
        store(sink.winners, winners);
    }
}

/// Gives `sink` the products of `rows` and one panel, which stays in the
/// first-level cache while the rows pass.
fn multiply<T: Feed<S, V>, S, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panel: usize,
    sink: &mut S,
) {
    let inputs = weights.padded_inputs();
    rows.check(inputs);
    assert!(
        weights.nr() == 4 * V && inputs.is_multiple_of(T::STEP),
        "panels packed for another kernel"
    );
    let weights = weights.panel(panel).as_ptr();
    let strip = |first_row, n_tiles| Strip {
        rows: rows.data[first_row * rows.stride..].as_ptr(),
        stride: rows.stride,
        n_tiles,
        weights,
        inputs,
    };
    let n_tiles = rows.n / TALLEST;
    // SAFETY: `kernels()` gives out a table where its instructions are; `check`
    // found `inputs` activations in each row, and `Panels` keeps as many weights
    // for each channel of a panel; sinks are made for `rows.n` rows.
    unsafe {
        T::feed::<TALLEST>(&strip(0, n_tiles), sink);
        if rows.n.is_multiple_of(TALLEST) {
            return;
        }
        let rest = strip(n_tiles * TALLEST, 1);
        match rows.n % TALLEST {
            1 => T::feed::<1>(&rest, sink),
            2 => T::feed::<2>(&rest, sink),
            3 => T::feed::<3>(&rest, sink),
            4 => T::feed::<4>(&rest, sink),
            5 => T::feed::<5>(&rest, sink),
            6 => T::feed::<6>(&rest, sink),
            _ => T::feed::<7>(&rest, sink),
        }
    }
}
