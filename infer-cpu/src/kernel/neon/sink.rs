//! What becomes of a tile's sums while they are in registers: outputs, or
//! maxima over rows, so that the widest features are never stored.

use std::arch::aarch64::*;
use std::array::from_fn;

use super::super::{Panels, holds_rows};
use super::lanes::{Lanes, Sums, load};

/// Takes the sums of one panel's channels, from the first row to the last.
pub trait Sink<L, const V: usize> {
    /// Takes the next `R` rows.
    ///
    /// # Safety
    /// They are no more than the sink was made for.
    unsafe fn take<const R: usize>(&mut self, sums: [[L; V]; R]);
}

/// Writes scaled sums with bias and ReLU.
pub struct Finish<const V: usize> {
    scale: [float32x4_t; V],
    bias: [float32x4_t; V],
    /// What outputs are raised to: 0, or NaN, which FMAXNM ignores.
    floor: float32x4_t,
    /// Where the next row goes.
    out: *mut f32,
    out_stride: usize,
}

impl<const V: usize> Finish<V> {
    /// For so many rows.
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
            floor: Lanes::splat(if weights.relu() { 0.0 } else { f32::NAN }),
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
                // SAFETY: `new` found room for as many rows as the caller, by the
                // contract of `take`, gives.
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
    /// One a channel.
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

/// Keeps the largest sums and whose they are.
pub struct ArgMax<L, const V: usize> {
    /// One a channel.
    pub largest: [L; V],
    /// The first row that has it.
    pub winners: [uint32x4_t; V],
    /// What the next row counts as.
    pub next_row: uint32x4_t,
}

impl<L: Sums, const V: usize> ArgMax<L, V> {
    /// Takes the largest sums of `n_rows` rows and the first rows that have
    /// them, counted from `next_row`.
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
