//! A sparse vector times a matrix, in fp32 for every type of stored weights.
//!
//! The 64 sums of a panel are 16 registers. The column of each nonzero input is widened in parts of
//! 16 weights and added. Columns come from main memory, and the gaps of skipped ones defeat the
//! hardware prefetcher, so the code prefetches the next columns itself.

use std::arch::aarch64::*;
use std::arch::asm;
use std::array::from_fn;
use std::ops::Range;

use super::lanes::{Lanes, load, store};
use crate::{GEMV_NR, Panels};

const CACHE_LINE_BYTES: usize = 64;

/// How far ahead columns are prefetched: twice a core's share of 10 GB/s times a latency of about
/// 150 ns.
const AHEAD_BYTES: usize = 2048;

/// [`Gemv`](super::super::Gemv) of weights stored as `W`.
pub fn gemv<W: Weight>(
    nonzero: &[(u32, f32)],
    weights: &Panels<W>,
    panels: Range<usize>,
    out: &mut [f32],
) {
    for (panel, out) in panels.zip(out.chunks_exact_mut(GEMV_NR)) {
        let sums = dot_products(nonzero, weights.panel(panel));
        let bias: [float32x4_t; 16] = load(&weights.biases()[panel * GEMV_NR..]);
        let scale = match weights.scales() {
            [] => [float32x4_t::splat(1.0); 16],
            scale => load(&scale[panel * GEMV_NR..]),
        };
        let sums = sums.as_flattened();
        // SAFETY: NEON is on every aarch64.
        let finished = from_fn(|v| unsafe { vfmaq_f32(bias[v], sums[v], scale[v]) });
        store::<float32x4_t, 16>(finished, out);
    }
}

fn dot_products<W: Weight>(nonzero: &[(u32, f32)], columns: &[W]) -> [[float32x4_t; 4]; 4] {
    let (columns, _) = columns.as_chunks::<GEMV_NR>();
    let ahead = AHEAD_BYTES / size_of::<[W; GEMV_NR]>();
    let mut sums = [[float32x4_t::splat(0.0); 4]; 4];
    for (i, &(input, value)) in nonzero.iter().enumerate() {
        // The next columns are known by their indices, so skipped ones cost nothing.
        if let Some(&(later, _)) = nonzero.get(i + ahead) {
            prefetch(columns.as_ptr().wrapping_add(later as usize));
        }
        let (column, _) = columns[input as usize].as_chunks();
        for part in 0..4 {
            let wide = W::widen(&column[part]);
            for v in 0..4 {
                // SAFETY: NEON is on every aarch64.
                sums[part][v] = unsafe { vfmaq_n_f32(sums[part][v], wide[v], value) };
            }
        }
    }
    sums
}

/// Prefetches one column into the first-level cache.
#[inline(always)]
fn prefetch<C>(column: *const C) {
    for line in (0..size_of::<C>()).step_by(CACHE_LINE_BYTES) {
        let address = column.wrapping_byte_add(line);
        // SAFETY: a prefetch is a hint and faults on no address.
        unsafe {
            asm!("prfm pldl1keep, [{}]", in(reg) address, options(nostack, preserves_flags, readonly));
        }
    }
}

/// A number type of stored weights.
pub trait Weight: Copy + Default {
    /// Converts sixteen weights to fp32, exactly.
    fn widen(weights: &[Self; 16]) -> [float32x4_t; 4];
}

impl Weight for f32 {
    #[inline(always)]
    fn widen(weights: &[f32; 16]) -> [float32x4_t; 4] {
        let (weights, _) = weights.as_chunks();
        from_fn(|v| Lanes::load(&weights[v]))
    }
}

impl Weight for i8 {
    /// Zipping with zeros, for which there are two pipes, moves bytes to the tops of lanes; the
    /// conversion divides by 2²⁴.
    #[inline(always)]
    fn widen(weights: &[i8; 16]) -> [float32x4_t; 4] {
        // SAFETY: the array has 16 numbers. NEON is on every aarch64.
        unsafe {
            let bytes = vld1q_s8(weights.as_ptr());
            let (zeros, zero_halves) = (vdupq_n_s8(0), vdupq_n_s16(0));
            let low = vreinterpretq_s16_s8(vzip1q_s8(zeros, bytes));
            let high = vreinterpretq_s16_s8(vzip2q_s8(zeros, bytes));
            [
                vzip1q_s16(zero_halves, low),
                vzip2q_s16(zero_halves, low),
                vzip1q_s16(zero_halves, high),
                vzip2q_s16(zero_halves, high),
            ]
            .map(|tops| vcvtq_n_f32_s32::<24>(vreinterpretq_s32_s16(tops)))
        }
    }
}
