//! Consumers of a tile's sums in registers: outputs, or maxima over rows, so that the widest
//! features are never stored.

use std::arch::aarch64::*;
use std::array::from_fn;

use super::lanes::{Lanes, Sums, load};
use crate::Panels;
use crate::rows::holds_rows;

/// Consumes the sums of one panel's channels, from the first row to the last.
pub trait Sink<L, const V: usize> {
    /// Takes the next `R` rows.
    ///
    /// # Safety
    /// In total, they are at most as many as the sink was made for.
    unsafe fn take<const R: usize>(&mut self, sums: [[L; V]; R]);
}

/// Applies scale, bias and ReLU, and writes the results.
pub struct Finish<const V: usize> {
    scale: [float32x4_t; V],
    bias: [float32x4_t; V],
    /// The lower limit of outputs: 0, or NaN, which FMAXNM ignores.
    floor: float32x4_t,
    /// The first output of the next row.
    out: *mut f32,
    out_stride: usize,
}

impl<const V: usize> Finish<V> {
    /// A sink for `n_rows` rows.
    pub fn new<W: Copy + Default>(
        weights: &Panels<W>,
        panel: usize,
        n_rows: usize,
        out: &mut [f32],
        out_stride: usize,
    ) -> Self {
        let channels = weights.channels(&(panel..panel + 1));
        assert!(holds_rows(out.len(), n_rows, out_stride, channels.end), "no room for the outputs");
        Self {
            scale: match weights.scales() {
                [] => [Lanes::splat(1.0); V],
                scale => load(&scale[channels.clone()]),
            },
            bias: load(&weights.biases()[channels.clone()]),
            // A floor of NaN makes the loop the same with and without a ReLU.
            floor: Lanes::splat(if weights.relu { 0.0 } else { f32::NAN }),
            out: out.as_mut_ptr().wrapping_add(channels.start),
            out_stride,
        }
    }
}

impl<L: Sums, const V: usize> Sink<L, V> for Finish<V> {
    #[inline(always)]
    unsafe fn take<const R: usize>(&mut self, sums: [[L; V]; R]) {
        for sums in sums {
            for (v, sums) in sums.into_iter().enumerate() {
                // SAFETY: `Finish::new` asserted room for `n_rows` rows, and `tile::multiply` feeds
                // the rows of the `Rows` that has this `n`.
                unsafe {
                    let finished = vfmaq_f32(self.bias[v], sums.to_f32(), self.scale[v]);
                    vst1q_f32(self.out.add(4 * v), vmaxnmq_f32(finished, self.floor));
                }
            }
            self.out = self.out.wrapping_add(self.out_stride);
        }
    }
}

/// Keeps the largest sums.
pub struct Max<L, const V: usize> {
    /// The largest sum of each channel.
    pub largest: [L; V],
}

impl<L: Sums, const V: usize> Sink<L, V> for Max<L, V> {
    #[inline(always)]
    unsafe fn take<const R: usize>(&mut self, sums: [[L; V]; R]) {
        for sums in sums {
            self.largest = from_fn(|v| self.largest[v].larger(sums[v]));
        }
    }
}

/// Keeps the largest sums and their rows.
pub struct ArgMax<L, const V: usize> {
    /// The largest sum of each channel.
    pub largest: [L; V],
    /// The first row that has it.
    pub winners: [uint32x4_t; V],
    pub next_row: uint32x4_t,
}

impl<L: Sums, const V: usize> ArgMax<L, V> {
    /// Merges the largest sums of the next `n_rows` rows, with the first rows that have them,
    /// counted from `next_row`.
    #[inline(always)]
    pub fn merge(&mut self, sums: [L; V], rows: [uint32x4_t; V], n_rows: usize) {
        for v in 0..V {
            let raised = sums[v].exceeds(self.largest[v]);
            self.largest[v] = self.largest[v].replaced(raised, sums[v]);
            self.winners[v] = self.winners[v].replaced(raised, plus(self.next_row, rows[v]));
        }
        self.next_row = plus(self.next_row, Lanes::splat(n_rows as u32));
    }
}

impl<L: Sums, const V: usize> Sink<L, V> for ArgMax<L, V> {
    #[inline(always)]
    unsafe fn take<const R: usize>(&mut self, sums: [[L; V]; R]) {
        for sums in sums {
            self.merge(sums, [Lanes::splat(0); V], 1);
        }
    }
}

#[inline(always)]
fn plus(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
    // SAFETY: NEON is on every aarch64.
    unsafe { vaddq_u32(a, b) }
}
