//! NEON with arithmetic in fp16 (FEAT_FP16): twice the lanes of fp32.
//!
//! The register tile, 8 rows by 16 channels:
//!
//! ```text
//!                       w[0] channels 0-7   w[1] channels 8-15
//!
//! a[0]  inputs k..k+8   sums[0][0]          sums[0][1]
//! a[1]                  sums[1][0]          sums[1][1]
//! ...                   ...                 ...
//! a[7]                  sums[7][0]          sums[7][1]
//! ```
//!
//! As in fp32, there are 16 sums and 8 registers of activations, which must be among the first 16
//! for FMLA to read them by element. The sums of [`F16_CHUNK`] inputs are added in fp16 to those of
//! earlier chunks, which are in memory. Since conversions are slow, sums are promoted to fp32 only
//! after a block of [`F16_BLOCK`] inputs, more than most of PointNet's layers have, and of maxima
//! only the largest of eight rows.

use std::arch::aarch64::*;
use std::arch::is_aarch64_feature_detected;
use std::hint::black_box;

use half::f16;

use super::declare_kernels;
use super::neon::NEON;
use super::neon::lanes::Lanes;
use super::neon::sink::Sink;
use super::neon::tile::{Feed, Strip, Tile, VECTOR_BYTES, gemm};
use super::scalar::{F16_BLOCK, F16_CHUNK};

mod half_sink;

use half_sink::{Blocks, HalfSink};

declare_kernels!(NeonF16, runs_here: is_aarch64_feature_detected!("fp16"), {
    f16: Some(gemm::<F16, 4>()),
    ..NEON
});

struct F16;

impl Tile<4> for F16 {
    type Activation = f16;
    type Weight = f16;
    type Sums = float32x4_t;
}

impl<S: HalfSink + Sink<float32x4_t, 4>> Feed<S, 4> for F16 {
    unsafe fn feed<const R: usize>(strip: &Strip<f16, f16>, sink: &mut S) {
        // SAFETY: `tile::multiply` made the strip of `Rows` and `Panels` that it checked;
        // `kernels()` gives out the table only where FEAT_FP16 is.
        unsafe {
            match strip.inputs {
                ..=F16_BLOCK => tile_f16_8x16::<S, R>(strip, sink),
                _ => feed_blocks::<S, R>(strip, sink),
            }
        }
    }
}

/// Feeds sums of several blocks, which are added in fp32.
///
/// # Safety
/// As [`Feed::feed`].
unsafe fn feed_blocks<S: Sink<float32x4_t, 4>, const R: usize>(
    strip: &Strip<f16, f16>,
    sink: &mut S,
) {
    for tile in 0..strip.n_tiles {
        let mut blocks = Blocks::<R> { sums: [[Lanes::splat(0.0); 4]; R] };
        for first in (0..strip.inputs).step_by(F16_BLOCK) {
            let block = Strip {
                rows: strip.rows.wrapping_add(tile * R * strip.stride + first),
                weights: strip.weights.wrapping_add(first * 16),
                inputs: F16_BLOCK.min(strip.inputs - first),
                n_tiles: 1,
                ..*strip
            };
            // SAFETY: `block` is a part of the `Strip` that consists of whole STEPs, and `Blocks`
            // takes R rows.
            unsafe { tile_f16_8x16::<_, R>(&block, &mut blocks) };
        }
        // SAFETY: `tile::multiply` feeds a sink the rows that it was made for.
        unsafe { sink.take(blocks.sums) };
    }
}

/// Feeds sums of one block.
///
/// # Safety
/// As [`Feed::feed`].
#[inline(never)]
#[target_feature(enable = "neon,fp16")]
unsafe fn tile_f16_8x16<S: HalfSink, const R: usize>(strip: &Strip<f16, f16>, sink: &mut S) {
    let zero = vreinterpretq_f16_u16(vdupq_n_u16(0));
    let mut rows: [*const f16; R] = strip.first_rows();
    // `black_box` keeps the sums of earlier chunks in memory: as variables they would take
    // registers from the inner loop.
    let mut memory = [[zero; 2]; R];
    for _ in 0..strip.n_tiles {
        let (mut weights, mut at) = (strip.weights, 0);
        loop {
            let is_first = at == 0;
            let chunk_end = strip.row_bytes().min(at + F16_CHUNK * size_of::<f16>());
            let mut sums = [[zero; 2]; R];
            while at < chunk_end {
                // SAFETY: a `Strip` has R rows of whole STEPs, here of 8 inputs, and 16 weights for
                // each input.
                unsafe {
                    let a = rows.map(|row| load(row.byte_add(at)));
                    add_inputs(&mut sums, &a, weights);
                    weights = weights.add(128);
                }
                at += VECTOR_BYTES;
            }
            if !is_first {
                for (sums, before) in sums.iter_mut().zip(black_box(&mut memory)) {
                    sums[0] = vaddq_f16(sums[0], before[0]);
                    sums[1] = vaddq_f16(sums[1], before[1]);
                }
            }
            if at >= strip.row_bytes() {
                // SAFETY: `tile::multiply` feeds a sink the rows that it was made for.
                unsafe { sink.take_half(&sums) };
                break;
            }
            *black_box(&mut memory) = sums;
        }
        rows = strip.next_rows(rows);
    }
}

/// Adds the products of 8 inputs of each row.
///
/// # Safety
/// `weights` points at 16 weights for each of the 8 inputs.
#[inline]
#[target_feature(enable = "neon,fp16")]
unsafe fn add_inputs<const R: usize>(
    sums: &mut [[float16x8_t; 2]; R],
    a: &[float16x8_t; R],
    weights: *const f16,
) {
    // SAFETY: `Panels` has `nr` = 16 weights for each of the 8 inputs.
    unsafe {
        add_input::<0, R>(sums, a, weights);
        add_input::<1, R>(sums, a, weights.add(16));
        add_input::<2, R>(sums, a, weights.add(32));
        add_input::<3, R>(sums, a, weights.add(48));
        add_input::<4, R>(sums, a, weights.add(64));
        add_input::<5, R>(sums, a, weights.add(80));
        add_input::<6, R>(sums, a, weights.add(96));
        add_input::<7, R>(sums, a, weights.add(112));
    }
}

/// Adds the products of the input that is lane `LANE` of the activations.
///
/// # Safety
/// `weights` points at 16 weights.
#[inline]
#[target_feature(enable = "neon,fp16")]
unsafe fn add_input<const LANE: i32, const R: usize>(
    sums: &mut [[float16x8_t; 2]; R],
    a: &[float16x8_t; R],
    weights: *const f16,
) {
    // SAFETY: `Panels` has `nr` = 16 weights for each input.
    let w = unsafe { [load(weights), load(weights.add(8))] };
    for (sums, &a) in sums.iter_mut().zip(a) {
        sums[0] = vfmaq_laneq_f16::<LANE>(sums[0], w[0], a);
        sums[1] = vfmaq_laneq_f16::<LANE>(sums[1], w[1], a);
    }
}

/// # Safety
/// `from` points at 8 numbers.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn load(from: *const f16) -> float16x8_t {
    // SAFETY: all pointers lie within a `Strip`, whose rows and weights come in whole vectors;
    // `f16` is a transparent `u16`.
    vreinterpretq_f16_u16(unsafe { vld1q_u16(from.cast()) })
}
