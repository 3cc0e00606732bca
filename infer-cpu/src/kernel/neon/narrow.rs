//! Activations rounded to fp16 and to seven bits.

use std::arch::aarch64::*;

use half::f16;

use super::super::I8_LARGEST;
use super::lanes::Lanes;

/// Numbers in a batch.
const BATCH: usize = 16;

/// [`Kernels::narrow_f16`](super::super::Kernels::narrow_f16).
pub fn to_f16(values: &[f32], out: &mut [f16]) -> f32 {
    let mut largest = float32x4_t::splat(0.0);
    for_each_batch(values, out, |values, out| largest = round_to_f16(values, out, largest));
    // SAFETY: NEON is on every aarch64.
    unsafe { vmaxnmvq_f32(largest) }
}

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
fn for_each_batch<T: Copy + Default>(
    values: &[f32],
    out: &mut [T],
    mut round: impl FnMut(&[f32; BATCH], &mut [T; BATCH]),
) {
    let (batches, rest) = values.as_chunks();
    let (out, out_rest) = out[..values.len()].as_chunks_mut();
    for (values, out) in batches.iter().zip(out) {
        round(values, out);
    }
    if !rest.is_empty() {
        let (mut last, mut rounded) = ([0.0; BATCH], [T::default(); BATCH]);
        last[..rest.len()].copy_from_slice(rest);
        round(&last, &mut rounded);
        out_rest.copy_from_slice(&rounded[..rest.len()]);
    }
}

/// Returns `largest`, raised to the magnitudes of the values.
#[inline(always)]
fn round_to_f16(
    values: &[f32; BATCH],
    out: &mut [f16; BATCH],
    mut largest: float32x4_t,
) -> float32x4_t {
    let (values, (out, _)) = (values.as_chunks().0, out.as_chunks_mut::<8>());
    for (pair, out) in values.chunks_exact(2).zip(out) {
        let (low, high) = (float32x4_t::load(&pair[0]), float32x4_t::load(&pair[1]));
        // SAFETY: the array has eight elements, and `f16` is a transparent `u16`. NEON and its
        // conversions of fp16 are on every aarch64.
        unsafe {
            let rounded = vcvt_high_f16_f32(vcvt_f16_f32(low), high);
            vst1q_u16(out.as_mut_ptr().cast(), vreinterpretq_u16_f16(rounded));
            largest = vmaxnmq_f32(vmaxnmq_f32(largest, vabsq_f32(low)), vabsq_f32(high));
        }
    }
    largest
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
