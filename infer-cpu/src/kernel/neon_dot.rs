//! NEON with SDOT (FEAT_DotProd) for int8: four products a lane.
//!
//! The register tile, 8 rows by 8 channels:
//!
//! ```text
//!                        w[0] channels 0-3   w[1] channels 4-7
//!                        four inputs each    four inputs each
//!
//! a[0]  inputs k..k+16   sums[0][0]          sums[0][1]
//! a[1]                   sums[1][0]          sums[1][1]
//! ...                    ...                 ...
//! a[7]                   sums[7][0]          sums[7][1]
//! ```
//!
//! The tile of fp32 with a group of four inputs in the place of one: SDOT reads
//! a group of activations by element and adds its four products with each of
//! four channels. Activations have seven bits, so they are valid signed bytes.

use std::arch::aarch64::*;
use std::arch::{asm, is_aarch64_feature_detected};

use super::declare_kernels;
use super::neon::NEON;
use super::neon::sink::Sink;
use super::neon::tile::{Feed, Strip, Tile, VECTOR_BYTES, gemm};

declare_kernels!(NeonDot, runs_here: is_aarch64_feature_detected!("dotprod"), {
    i8: Some(gemm::<I8, 2>()),
    prefilters: true,
    ..NEON
});

struct I8;

impl Tile<2> for I8 {
    type Activation = u8;
    type Weight = i8;
    type Sums = int32x4_t;
}

impl<S: Sink<int32x4_t, 2>> Feed<S, 2> for I8 {
    unsafe fn feed<const R: usize>(strip: &Strip<u8, i8>, sink: &mut S) {
        // SAFETY: the contract of `Feed::feed`.
        unsafe { tile_i8_8x8::<S, R>(strip, sink) }
    }
}

/// # Safety
/// As [`Feed::feed`].
#[inline(never)]
#[target_feature(enable = "neon,dotprod")]
unsafe fn tile_i8_8x8<S: Sink<int32x4_t, 2>, const R: usize>(strip: &Strip<u8, i8>, sink: &mut S) {
    let mut rows: [*const u8; R] = strip.first_rows();
    for _ in 0..strip.n_tiles {
        let mut sums = [[vdupq_n_s32(0); 2]; R];
        let (mut weights, mut at) = (strip.weights, 0);
        while at < strip.row_bytes() {
            // SAFETY: 16 inputs of R rows are there, and 8 weights for each.
            unsafe {
                let a = rows.map(|row| vreinterpretq_s8_u8(vld1q_u8(row.byte_add(at))));
                add_group::<0, R>(&mut sums, &a, weights);
                add_group::<1, R>(&mut sums, &a, weights.add(32));
                add_group::<2, R>(&mut sums, &a, weights.add(64));
                add_group::<3, R>(&mut sums, &a, weights.add(96));
                weights = weights.add(128);
            }
            at += VECTOR_BYTES;
        }
        // SAFETY: the sink has room for the strip's rows, by the contract of `Feed::feed`.
        unsafe { sink.take(sums) };
        rows = strip.next_rows(rows);
    }
}

/// Adds the products of the four inputs that are lane `LANE` of the
/// activations.
///
/// # Safety
/// There are 32 weights.
#[inline]
#[target_feature(enable = "neon,dotprod")]
unsafe fn add_group<const LANE: u32, const R: usize>(
    sums: &mut [[int32x4_t; 2]; R],
    a: &[int8x16_t; R],
    weights: *const i8,
) {
    // SAFETY: this function's contract.
    let w = unsafe { [vld1q_s8(weights), vld1q_s8(weights.add(16))] };
    for (sums, &a) in sums.iter_mut().zip(a) {
        sums[0] = sdot::<LANE>(sums[0], w[0], a);
        sums[1] = sdot::<LANE>(sums[1], w[1], a);
    }
}

/// The instruction, which the standard library does not yet offer.
#[inline]
#[target_feature(enable = "neon,dotprod")]
fn sdot<const LANE: u32>(mut sums: int32x4_t, w: int8x16_t, a: int8x16_t) -> int32x4_t {
    // SAFETY: changes nothing but `sums`; callers have the feature.
    unsafe {
        asm!(
            "sdot {sums:v}.4s, {w:v}.16b, {a:v}.4b[{lane}]",
            sums = inout(vreg) sums,
            w = in(vreg) w,
            a = in(vreg) a,
            lane = const LANE,
            options(pure, nomem, nostack, preserves_flags),
        );
    }
    sums
}
