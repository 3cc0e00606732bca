//! NEON with arithmetic in fp16 (FEAT_FP16): twice the lanes of fp32.
//!
//! The register tile, 8 rows by 16 channels:
//!
//! ```text
//!                       w[0] channels 0-7   w[1] channels 8-15
//!
//! a[0]  inputs k..k+8   chunk[0][0]         chunk[0][1]
//! a[1]                  chunk[1][0]         chunk[1][1]
//! ...                   ...                 ...
//! a[7]                  chunk[7][0]         chunk[7][1]
//! ```
//!
//! As in fp32, 16 sums and 8 registers of activations, which must be among the
//! first 16 for FMLA to read them by element. Sums of [`F16_CHUNK`] inputs are
//! all that rounds often. They are added in fp16 to those of a block, and
//! blocks to sums in fp32; both lie in memory, out of the inner loop's way.
//! Conversion to fp32 is slow, so there is one a block, which is all of
//! PointNet's layers.

use std::arch::aarch64::*;
use std::arch::is_aarch64_feature_detected;

use half::f16;

use super::declare_kernels;
use super::neon::sink::Sink;
use super::neon::tile::{Operands, Place, Tile, gemm};
use super::neon::{GEMM_F32, fps, gemv, narrow};
use super::scalar::{F16_BLOCK, F16_CHUNK};

declare_kernels!(NeonF16, runs_here: is_aarch64_feature_detected!("fp16"), {
    f32: Some(GEMM_F32),
    f16: Some(gemm::<F16, 4>()),
    i8: None,
    gemv_f32: gemv::gemv::<f32>,
    gemv_f16: gemv::gemv::<f16>,
    gemv_i8: gemv::gemv::<i8>,
    narrow_f16: narrow::to_f16,
    narrow_i8: narrow::to_i8,
    fps_step: fps::step,
});

struct F16;

impl Tile<4> for F16 {
    type Activation = f16;
    type Weight = f16;
    type Sums = float32x4_t;
    const STEP: usize = 8;

    unsafe fn run<S: Sink<float32x4_t, 4>, const R: usize>(
        operands: &Operands<f16, f16>,
        place: Place,
        sink: &mut S,
    ) {
        // SAFETY: the caller's.
        unsafe { tile_f16_8x16::<S, R>(operands, place, sink) }
    }
}

/// # Safety
/// As [`Tile::run`].
#[inline(never)]
#[target_feature(enable = "neon,fp16")]
unsafe fn tile_f16_8x16<S: Sink<float32x4_t, 4>, const R: usize>(
    operands: &Operands<f16, f16>,
    place: Place,
    sink: &mut S,
) {
    let rows: [*const f16; R] = operands.row_pointers();
    let zero = vreinterpretq_f16_u16(vdupq_n_u16(0));
    let mut sums = [[vdupq_n_f32(0.0); 4]; R];
    let mut k = 0;
    while k < operands.inputs {
        let block_end = operands.inputs.min(k + F16_BLOCK);
        let mut block = [[zero; 2]; R];
        while k < block_end {
            let chunk_end = block_end.min(k + F16_CHUNK);
            let mut chunk = [[zero; 2]; R];
            while k < chunk_end {
                // SAFETY: the number of inputs is a multiple of STEP, so inputs
                // k to k + 7 of R rows are there, and 16 weights for each.
                unsafe { add_inputs(&mut chunk, &rows, operands.weights, k) };
                k += F16::STEP;
            }
            for (block, chunk) in block.iter_mut().zip(chunk) {
                block[0] = vaddq_f16(block[0], chunk[0]);
                block[1] = vaddq_f16(block[1], chunk[1]);
            }
        }
        for (sums, block) in sums.iter_mut().zip(block) {
            sums[0] = vaddq_f32(sums[0], vcvt_f32_f16(vget_low_f16(block[0])));
            sums[1] = vaddq_f32(sums[1], vcvt_high_f32_f16(block[0]));
            sums[2] = vaddq_f32(sums[2], vcvt_f32_f16(vget_low_f16(block[1])));
            sums[3] = vaddq_f32(sums[3], vcvt_high_f32_f16(block[1]));
        }
    }
    sink.take(place, &sums);
}

/// Adds the products of inputs `k` to `k + 7`.
///
/// # Safety
/// They are in every row, and so are 16 weights for each.
#[inline]
#[target_feature(enable = "neon,fp16")]
unsafe fn add_inputs<const R: usize>(
    sums: &mut [[float16x8_t; 2]; R],
    rows: &[*const f16; R],
    weights: *const f16,
    k: usize,
) {
    // SAFETY: the caller's; an `f16` is its bits.
    unsafe {
        let a = rows.map(|row| load(row.add(k)));
        let weights = weights.add(k * 16);
        add_input::<0, R>(sums, &a, weights);
        add_input::<1, R>(sums, &a, weights.add(16));
        add_input::<2, R>(sums, &a, weights.add(32));
        add_input::<3, R>(sums, &a, weights.add(48));
        add_input::<4, R>(sums, &a, weights.add(64));
        add_input::<5, R>(sums, &a, weights.add(80));
        add_input::<6, R>(sums, &a, weights.add(96));
        add_input::<7, R>(sums, &a, weights.add(112));
    }
}

/// Adds the products of the input that is lane `LANE` of the activations.
///
/// # Safety
/// There are 16 weights.
#[inline]
#[target_feature(enable = "neon,fp16")]
unsafe fn add_input<const LANE: i32, const R: usize>(
    sums: &mut [[float16x8_t; 2]; R],
    a: &[float16x8_t; R],
    weights: *const f16,
) {
    // SAFETY: the caller's.
    let w = unsafe { [load(weights), load(weights.add(8))] };
    for (sums, &a) in sums.iter_mut().zip(a) {
        sums[0] = vfmaq_laneq_f16::<LANE>(sums[0], w[0], a);
        sums[1] = vfmaq_laneq_f16::<LANE>(sums[1], w[1], a);
    }
}

/// # Safety
/// There are 8 numbers.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn load(from: *const f16) -> float16x8_t {
    // SAFETY: the caller's; an `f16` is its bits.
    vreinterpretq_f16_u16(unsafe { vld1q_u16(from.cast()) })
}
