//! Activations rounded to fp16 and to seven bits.

use std::arch::aarch64::*;

use half::f16;

use super::super::I8_LARGEST;
use super::lanes::Lanes;

/// Numbers rounded at a time.
const BATCH: usize = 8;

/// [`Kernels::narrow_f16`](super::super::Kernels::narrow_f16).
pub fn to_f16(values: &[f32], out: &mut [f16]) -> f32 {
    let mut largest = float32x4_t::splat(0.0);
    for_each_batch(values, out, |values, out| largest = round_to_f16(values, out, largest));
    // SAFETY: NEON is on every aarch64.
    unsafe { vmaxnmvq_f32(largest) }
}

/// [`Kernels::narrow_i8`](super::super::Kernels::narrow_i8).
pub fn to_i8(values: &[f32], per_unit: f32, out: &mut [u8]) -> u64 {
    let mut n_clipped = 0;
    for_each_batch(values, out, |values, out| {
        n_clipped += u64::from(round_to_i8(values, per_unit, out));
    });
    n_clipped
}

/// Calls `round` with eight values and room for them at a time; zeros fill up
/// the last.
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

/// Raises `largest` to the magnitudes.
#[inline(always)]
fn round_to_f16(
    values: &[f32; BATCH],
    out: &mut [f16; BATCH],
    largest: float32x4_t,
) -> float32x4_t {
    // SAFETY: eight numbers are there, and room for eight; an `f16` is its
    // bits. NEON and its conversions of fp16 are on every aarch64.
    unsafe {
        let low = vld1q_f32(values.as_ptr());
        let high = vld1q_f32(values.as_ptr().add(4));
        let rounded = vcvt_high_f16_f32(vcvt_f16_f32(low), high);
        vst1q_u16(out.as_mut_ptr().cast(), vreinterpretq_u16_f16(rounded));
        vmaxnmq_f32(vmaxnmq_f32(largest, vabsq_f32(low)), vabsq_f32(high))
    }
}

/// Returns how many were clipped at the top.
#[inline(always)]
fn round_to_i8(values: &[f32; BATCH], per_unit: f32, out: &mut [u8; BATCH]) -> u32 {
    // SAFETY: eight numbers are there, and room for eight. NEON is on every
    // aarch64.
    unsafe {
        let level = |at: usize| {
            // To nearest, ties to even; what exceeds i32 saturates, NaN is 0.
            vcvtnq_s32_f32(vmulq_n_f32(vld1q_f32(values.as_ptr().add(at)), per_unit))
        };
        // Saturates at 0 and at 65535.
        let levels = vqmovun_high_s32(vqmovun_s32(level(0)), level(4));
        let clipped = vcgtq_u16(levels, vdupq_n_u16(I8_LARGEST.into()));
        let levels = vqmovn_u16(levels);
        vst1_u8(out.as_mut_ptr(), vmin_u8(levels, vdup_n_u8(I8_LARGEST)));
        u32::from(vaddvq_u16(vshrq_n_u16::<15>(clipped)))
    }
}
