//! Activations rounded to seven bits.

use std::arch::aarch64::*;

use super::lanes::Lanes;
use crate::I8_LARGEST;

/// Numbers in a batch.
const BATCH: usize = 16;

/// [`Kernels::narrow_i8`](super::super::Kernels::narrow_i8).
pub fn to_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
    let mut n_clipped = uint32x4_t::splat(0);
    for_each_batch(values, out, |values, out| {
        n_clipped = round_to_i8(values, per_unit, out, n_clipped);
    });
    // SAFETY: NEON is on every aarch64.
    unsafe { vaddlvq_u32(n_clipped) }
}

/// Calls `round` with batches of values and room for the results; the last batch is padded with
/// zeros.
#[inline(always)]
fn for_each_batch(
    values: &[f32],
    out: &mut [u8],
    mut round: impl FnMut(&[f32; BATCH], &mut [u8; BATCH]),
) {
    let (batches, rest) = values.as_chunks();
    let (out, out_rest) = out[..values.len()].as_chunks_mut();
    for (values, out) in batches.iter().zip(out) {
        round(values, out);
    }
    if !rest.is_empty() {
        let (mut last, mut rounded) = ([0.0; BATCH], [0; BATCH]);
        last[..rest.len()].copy_from_slice(rest);
        round(&last, &mut rounded);
        out_rest.copy_from_slice(&rounded[..rest.len()]);
    }
}

/// Returns `n_clipped` plus the number of values that were clipped at the top.
#[inline(always)]
fn round_to_i8(
    values: &[f32; BATCH],
    per_unit: f32,
    out: &mut [u8; BATCH],
    n_clipped: uint32x4_t,
) -> uint32x4_t {
    let (values, _) = values.as_chunks();
    // SAFETY: the array has sixteen elements. NEON is on every aarch64.
    unsafe {
        // Rounds to nearest, ties to even; saturates beyond i32; NaN becomes 0.
        let level = |v: usize| vcvtnq_s32_f32(vmulq_n_f32(Lanes::load(&values[v]), per_unit));
        // Saturate at 0 and 65535, then at 255.
        let low = vqmovun_high_s32(vqmovun_s32(level(0)), level(1));
        let high = vqmovun_high_s32(vqmovun_s32(level(2)), level(3));
        let levels = vqmovn_high_u16(vqmovn_u16(low), high);
        vst1q_u8(out.as_mut_ptr(), vminq_u8(levels, vdupq_n_u8(I8_LARGEST)));
        vpadalq_u16(n_clipped, vpaddlq_u8(vshrq_n_u8::<7>(levels)))
    }
}
