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
use std::ops::Range;

use half::f16;

use super::declare_kernels;
use super::neon::tile::{self, Operands, Tile, gemm};
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

    unsafe fn sums<const R: usize>(operands: &Operands<f16, f16>) -> [[float32x4_t; 4]; R] {
        let block = |first| {
            let inputs = first..operands.inputs.min(first + F16_BLOCK);
            // SAFETY: the caller's; blocks are whole STEPs.
            unsafe { tile_f16_8x16::<R>(operands, inputs) }.map(promoted)
        };
        let mut sums = block(0);
        for first in (F16_BLOCK..operands.inputs).step_by(F16_BLOCK) {
            for (sum, block) in sums.as_flattened_mut().iter_mut().zip(block(first).as_flattened())
            {
                // SAFETY: NEON is on every aarch64.
                *sum = unsafe { vaddq_f32(*sum, *block) };
            }
        }
        sums
    }

    unsafe fn largest<const R: usize>(operands: &Operands<f16, f16>) -> [float32x4_t; 4] {
        // SAFETY: the caller's.
        unsafe {
            match operands.inputs {
                inputs @ ..=F16_BLOCK => promoted(largest(tile_f16_8x16::<R>(operands, 0..inputs))),
                _ => tile::largest(Self::sums::<R>(operands)),
            }
        }
    }

    unsafe fn first_largest<const R: usize>(
        operands: &Operands<f16, f16>,
    ) -> ([float32x4_t; 4], [uint32x4_t; 4]) {
        // SAFETY: the caller's.
        unsafe {
            match operands.inputs {
                inputs @ ..=F16_BLOCK => first_largest(tile_f16_8x16::<R>(operands, 0..inputs)),
                _ => tile::first_largest(Self::sums::<R>(operands)),
            }
        }
    }
}

/// [`tile::largest`] in fp16.
#[inline]
#[target_feature(enable = "neon,fp16")]
fn largest<const R: usize>(sums: [[float16x8_t; 2]; R]) -> [float16x8_t; 2] {
    let lowest = vreinterpretq_f16_u16(vdupq_n_u16(f16::NEG_INFINITY.to_bits()));
    sums.iter().fold([lowest; 2], |largest, sums| {
        [vmaxnmq_f16(largest[0], sums[0]), vmaxnmq_f16(largest[1], sums[1])]
    })
}

/// [`tile::first_largest`] in fp16, and then in fp32.
#[inline]
#[target_feature(enable = "neon,fp16")]
fn first_largest<const R: usize>(
    sums: [[float16x8_t; 2]; R],
) -> ([float32x4_t; 4], [uint32x4_t; 4]) {
    let lowest = vreinterpretq_f16_u16(vdupq_n_u16(f16::NEG_INFINITY.to_bits()));
    let (mut largest, mut rows) = ([lowest; 2], [vdupq_n_u16(0); 2]);
    for (row, sums) in (0..).map(|row| vdupq_n_u16(row)).zip(&sums) {
        for v in 0..2 {
            let raised = vcgtq_f16(sums[v], largest[v]);
            largest[v] = vbslq_f16(raised, sums[v], largest[v]);
            rows[v] = vbslq_u16(raised, row, rows[v]);
        }
    }
    let [left, right] = rows;
    let rows = [
        vmovl_u16(vget_low_u16(left)),
        vmovl_high_u16(left),
        vmovl_u16(vget_low_u16(right)),
        vmovl_high_u16(right),
    ];
    (promoted(largest), rows)
}

/// The same numbers in fp32.
#[inline(always)]
fn promoted([left, right]: [float16x8_t; 2]) -> [float32x4_t; 4] {
    // SAFETY: NEON and its conversions of fp16 are on every aarch64.
    unsafe {
        [
            vcvt_f32_f16(vget_low_f16(left)),
            vcvt_high_f32_f16(left),
            vcvt_f32_f16(vget_low_f16(right)),
            vcvt_high_f32_f16(right),
        ]
    }
}

/// The products of a block of inputs, summed chunk by chunk.
///
/// # Safety
/// As [`Tile::sums`], for a block of whole STEPs among the inputs.
#[inline(never)]
#[target_feature(enable = "neon,fp16")]
unsafe fn tile_f16_8x16<const R: usize>(
    operands: &Operands<f16, f16>,
    inputs: Range<usize>,
) -> [[float16x8_t; 2]; R] {
    let mut rows: [*const f16; R] = operands.row_pointers(inputs.start);
    let zero = vreinterpretq_f16_u16(vdupq_n_u16(0));
    let mut sums = [[zero; 2]; R];
    let mut k = inputs.start;
    while k < inputs.end {
        let chunk_end = inputs.end.min(k + F16_CHUNK);
        let mut chunk = [[zero; 2]; R];
        while k < chunk_end {
            // SAFETY: inputs k to k + 7 of R rows are there, and 16 weights for
            // each.
            unsafe { add_inputs(&mut chunk, &mut rows, operands.weights.add(k * 16)) };
            k += F16::STEP;
        }
        for (sums, chunk) in sums.iter_mut().zip(chunk) {
            sums[0] = vaddq_f16(sums[0], chunk[0]);
            sums[1] = vaddq_f16(sums[1], chunk[1]);
        }
    }
    sums
}

/// Adds the products of the next 8 inputs of each row.
///
/// # Safety
/// They are there, and so are 16 weights for each.
#[inline]
#[target_feature(enable = "neon,fp16")]
unsafe fn add_inputs<const R: usize>(
    sums: &mut [[float16x8_t; 2]; R],
    rows: &mut [*const f16; R],
    weights: *const f16,
) {
    // SAFETY: the caller's.
    unsafe {
        let a = rows.map(|row| load(row));
        *rows = rows.map(|row| row.add(F16::STEP));
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
