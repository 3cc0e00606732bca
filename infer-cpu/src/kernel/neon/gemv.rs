//! Sparse vector times matrix, in fp32 whatever the weights are stored as.
//!
//! The 64 sums of a block are 16 registers. The column of each input that is
//! not 0 is widened in parts of 16 weights and added. Columns come from main
//! memory, and the gaps of those left out confuse the machine's prefetcher: so
//! the columns to come are asked for in advance.

use std::arch::aarch64::*;
use std::arch::asm;
use std::array::from_fn;
use std::ops::Range;

use half::f16;

use super::super::Columns;
use super::lanes::Lanes;

const BLOCK: usize = Columns::<f32>::BLOCK;

const CACHE_LINE_BYTES: usize = 64;

/// How far ahead columns are asked for: a core's share of 10 GB/s times some
/// 150 ns until memory answers, and as much again.
const AHEAD_BYTES: usize = 2048;

/// [`Gemv`](super::super::Gemv) of weights stored as `W`.
pub fn gemv<W: Weight>(
    nonzero: &[(u32, f32)],
    weights: &Columns<W>,
    blocks: Range<usize>,
    out: &mut [f32],
) {
    for (block, out) in blocks.zip(out.chunks_exact_mut(BLOCK)) {
        let sums = dot_products(nonzero, weights.block(block));
        let (bias, _) = weights.bias[block * BLOCK..][..BLOCK].as_chunks();
        let (out, _) = out.as_chunks_mut();
        for (v, sum) in sums.as_flattened().iter().enumerate() {
            let scale = match weights.scale[..] {
                [] => float32x4_t::splat(1.0),
                ref scale => Lanes::load(&scale[block * BLOCK..].as_chunks().0[v]),
            };
            // SAFETY: NEON is on every aarch64.
            unsafe { vfmaq_f32(Lanes::load(&bias[v]), *sum, scale) }.store(&mut out[v]);
        }
    }
}

fn dot_products<W: Weight>(nonzero: &[(u32, f32)], columns: &[W]) -> [[float32x4_t; 4]; 4] {
    let ahead = AHEAD_BYTES / (BLOCK * size_of::<W>());
    let mut sums = [[float32x4_t::splat(0.0); 4]; 4];
    for (i, &(input, value)) in nonzero.iter().enumerate() {
        if let Some(&(later, _)) = nonzero.get(i + ahead) {
            prefetch(columns.as_ptr().wrapping_add(later as usize * BLOCK));
        }
        let (column, _) = columns[input as usize * BLOCK..][..BLOCK].as_chunks();
        for (sums, part) in sums.iter_mut().zip(column) {
            let wide = W::widen(part);
            for (sum, wide) in sums.iter_mut().zip(wide) {
                // SAFETY: NEON is on every aarch64.
                *sum = unsafe { vfmaq_n_f32(*sum, wide, value) };
            }
        }
    }
    sums
}

/// Asks for one column to be brought into the first-level cache.
#[inline(always)]
fn prefetch<W>(column: *const W) {
    for line in 0..(BLOCK * size_of::<W>()).div_ceil(CACHE_LINE_BYTES) {
        let address = column.wrapping_byte_add(line * CACHE_LINE_BYTES);
        // SAFETY: a hint; no address can make it fault.
        unsafe {
            asm!("prfm pldl1keep, [{}]", in(reg) address, options(nostack, preserves_flags, readonly));
        }
    }
}

/// A number that weights are stored as.
pub trait Weight: Copy + Default {
    /// Sixteen of them in fp32, exactly.
    fn widen(weights: &[Self; 16]) -> [float32x4_t; 4];
}

impl Weight for f32 {
    #[inline(always)]
    fn widen(weights: &[f32; 16]) -> [float32x4_t; 4] {
        let (weights, _) = weights.as_chunks();
        from_fn(|v| Lanes::load(&weights[v]))
    }
}

impl Weight for f16 {
    #[inline(always)]
    fn widen(weights: &[f16; 16]) -> [float32x4_t; 4] {
        let bits = weights.as_ptr().cast::<u16>();
        // SAFETY: 16 numbers are there, and an `f16` is its bits. NEON and its
        // conversions of fp16 are on every aarch64.
        unsafe {
            let low = vreinterpretq_f16_u16(vld1q_u16(bits));
            let high = vreinterpretq_f16_u16(vld1q_u16(bits.add(8)));
            [
                vcvt_f32_f16(vget_low_f16(low)),
                vcvt_high_f32_f16(low),
                vcvt_f32_f16(vget_low_f16(high)),
                vcvt_high_f32_f16(high),
            ]
        }
    }
}

impl Weight for i8 {
    /// A table look-up moves four bytes to the tops of four lanes; the
    /// conversion then divides by 2²⁴.
    #[inline(always)]
    fn widen(weights: &[i8; 16]) -> [float32x4_t; 4] {
        // SAFETY: 16 bytes are there. NEON is on every aarch64.
        unsafe {
            let bytes = vreinterpretq_u8_s8(vld1q_s8(weights.as_ptr()));
            LANE_TOPS.map(|tops| {
                let tops = vld1q_u8(tops.as_ptr());
                vcvtq_n_f32_s32::<24>(vreinterpretq_s32_u8(vqtbl1q_u8(bytes, tops)))
            })
        }
    }
}

/// For each quarter of a register, the bytes that go to the four lanes; what
/// is out of range becomes 0.
const LANE_TOPS: [[u8; 16]; 4] = {
    let mut tops = [[u8::MAX; 16]; 4];
    let mut byte = 0;
    while byte < 16 {
        tops[byte / 4][byte % 4 * 4 + 3] = byte as u8;
        byte += 1;
    }
    tops
};
