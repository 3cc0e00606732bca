//! Matrix products by register tiles: the parts that all number formats share.

use std::arch::asm;
use std::array::from_fn;
use std::ops::Range;

use super::lanes::{Lanes, Sums, load, store};
use super::sink::{ArgMax, Finish, Max};
use crate::table::Gemm;
use crate::{Panels, Rows};

/// Rows of the tallest tile.
const TALLEST: usize = 8;

/// The bytes of a row that one round of an inner loop processes.
pub const VECTOR_BYTES: usize = 16;

/// A register tile of rows by `V` vectors of four sums, in one number format.
pub trait Tile<const V: usize> {
    /// An element of rows.
    type Activation;
    /// An element of panels.
    type Weight: Copy + Default;
    type Sums: Sums;
    /// The inputs of one round of the inner loop.
    const STEP: usize = VECTOR_BYTES / size_of::<Self::Activation>();
}

/// A tile that feeds its sums to `S`.
pub trait Feed<S, const V: usize>: Tile<V> {
    /// Feeds the products of a strip to `sink` in tiles of `R` rows. The order of summation does
    /// not depend on `R`.
    ///
    /// # Safety
    /// The machine has the tile's instructions, the strip consists of `n_tiles * R` rows of
    /// `inputs` activations and `4 * V` weights for each input, and `sink` has room for these rows.
    unsafe fn feed<const R: usize>(strip: &Strip<Self::Activation, Self::Weight>, sink: &mut S);
}

/// Rows and one panel.
pub struct Strip<A, W> {
    /// The first activation of the first row.
    pub rows: *const A,
    /// The distance from one row to the next.
    pub stride: usize,
    pub n_tiles: usize,
    /// `4 * V` weights for each input.
    pub weights: *const W,
    /// The inputs of every row, a multiple of the tile's step.
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
    /// In inner loops an activation is at its row's pointer plus an offset that all rows share,
    /// which costs only the load. If the compiler knew that rows are a stride apart, it would
    /// compute the pointers by additions in the loop; an empty instruction hides it.
    #[inline(always)]
    pub fn first_rows<const R: usize>(&self) -> [*const A; R] {
        from_fn(|r| {
            let mut offset = r * self.stride;
            // SAFETY: the assembly has no instruction.
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

/// Defines a format with tiles of 8 rows by 8 channels: `[activation; weight] -> vector of sums`.
///
/// `$multiply_add` reads one of the four lanes of a vector of activations; a lane holds one input, or
/// a group of inputs for int8.
macro_rules! tile_8x8 {
    (
        $format:ident: [$activation:ty; $weight:ty] -> $sums:ty, $features:literal, fn $tile:ident,
        zero: $zero:expr, load: $load:ident -> $vector:ty, multiply_add: $multiply_add:ident
    ) => {
        struct $format;

        impl Tile<2> for $format {
            type Activation = $activation;
            type Weight = $weight;
            type Sums = $sums;
        }

        impl<S: Sink<$sums, 2>> Feed<S, 2> for $format {
            unsafe fn feed<const R: usize>(strip: &Strip<$activation, $weight>, sink: &mut S) {
                // SAFETY: `multiply` made the strip of `Rows` and `Panels` that it checked, and
                // `kernels()` gives out the table only where the instructions exist.
                unsafe { $tile::<S, R>(strip, sink) }
            }
        }

        /// # Safety
        /// As for [`Feed::feed`].
        #[inline(never)]
        #[target_feature(enable = $features)]
        unsafe fn $tile<S: Sink<$sums, 2>, const R: usize>(
            strip: &Strip<$activation, $weight>,
            sink: &mut S,
        ) {
            let mut rows: [*const $activation; R] = strip.first_rows();
            for _ in 0..strip.n_tiles {
                let mut sums = [[$zero; 2]; R];
                let (mut weights, mut at) = (strip.weights, 0);
                while at < strip.row_bytes() {
                    // SAFETY: a `Strip` has R rows of whole STEPs, here one vector, and two vectors
                    // of weights for each of its four lanes.
                    unsafe {
                        let a = rows.map(|row| $load(row.byte_add(at).cast()));
                        add_lane::<0, R>(&mut sums, &a, weights);
                        add_lane::<1, R>(&mut sums, &a, weights.byte_add(2 * VECTOR_BYTES));
                        add_lane::<2, R>(&mut sums, &a, weights.byte_add(4 * VECTOR_BYTES));
                        add_lane::<3, R>(&mut sums, &a, weights.byte_add(6 * VECTOR_BYTES));
                        weights = weights.byte_add(8 * VECTOR_BYTES);
                    }
                    at += VECTOR_BYTES;
                }
                // SAFETY: `multiply` feeds a sink the rows that it was made for.
                unsafe { sink.take(sums) };
                rows = strip.next_rows(rows);
            }
        }

        /// Adds the products of lane `LANE` of the activations.
        ///
        /// # Safety
        /// `weights` points at two vectors.
        #[inline]
        #[target_feature(enable = $features)]
        unsafe fn add_lane<const LANE: i32, const R: usize>(
            sums: &mut [[$sums; 2]; R],
            a: &[$vector; R],
            weights: *const $weight,
        ) {
            // SAFETY: `Panels` has `nr` = 8 weights for each input: two vectors for each lane.
            let w = unsafe { [$load(weights), $load(weights.byte_add(VECTOR_BYTES))] };
            for (sums, &a) in sums.iter_mut().zip(a) {
                sums[0] = $multiply_add::<LANE>(sums[0], w[0], a);
                sums[1] = $multiply_add::<LANE>(sums[1], w[1], a);
            }
        }
    };
}
pub(crate) use tile_8x8;

type Four<T, const V: usize> = <T as Tile<V>>::Sums;

/// A sum of a tile.
type Sum<T, const V: usize> = <Four<T, V> as Lanes>::Element;

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
        let mut sink = Finish::new(weights, panel, rows.n(), out, out_stride);
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

/// Feeds the products of `rows` and one panel to `sink`. The panel stays in the first-level cache
/// while the rows pass.
fn multiply<T: Feed<S, V>, S, const V: usize>(
    rows: &Rows<'_, T::Activation>,
    weights: &Panels<T::Weight>,
    panel: usize,
    sink: &mut S,
) {
    // Inner loops have no remainder: rows are read up to the padding of the panels.
    let inputs = weights.padded_inputs();
    rows.check(inputs);
    assert!(
        weights.nr() == 4 * V && inputs.is_multiple_of(T::STEP),
        "panels packed for another kernel"
    );
    let weights = weights.panel(panel).as_ptr();
    let strip = |first_row, n_tiles| Strip {
        rows: rows.data()[first_row * rows.stride()..].as_ptr(),
        stride: rows.stride(),
        n_tiles,
        weights,
        inputs,
    };
    let n_tiles = rows.n() / TALLEST;
    // SAFETY: `kernels()` gives out a table only where its instructions exist; `Rows::check` found
    // `inputs` activations in each row, and `Panels` has as many weights for each channel of a
    // panel; every sink is made for `rows.n()` rows.
    unsafe {
        T::feed::<TALLEST>(&strip(0, n_tiles), sink);
        if rows.n().is_multiple_of(TALLEST) {
            return;
        }
        // A constant number of rows keeps the sums in registers for every remainder.
        let rest = strip(n_tiles * TALLEST, 1);
        match rows.n() % TALLEST {
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
