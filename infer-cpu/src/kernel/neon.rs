//! NEON in fp32, and what all three NEON files share.
//!
//! The register tile, 8 rows by 8 channels:
//!
//! ```text
//!                     w0 (channels 0-3)  w1 (channels 4-7)
//!                            v                  v
//! row 0  a0[k k+1 k+2 k+3]  s00                s01
//! row 1  a1[k k+1 k+2 k+3]  s10                s11
//! ...                       ...                ...
//! row 7  a7[k k+1 k+2 k+3]  s70                s71
//! ```
//!
//! 16 sums, 8 registers of activations (4 inputs of a row each, which FMLA
//! reads by element) and the 2 weight vectors of the input at hand leave 6 of
//! 32 registers for weights under way. 16 sums are twice what two pipes of
//! latency 4 need, and 4 inputs take 16 loads beside 64 FMLA. Taller tiles
//! would need their rows packed.

use std::arch::aarch64::*;
use std::array::from_fn;
use std::ops::Range;

use super::{Gemm, Panels, Rows, declare_kernels};

pub(super) mod fps;
pub(super) mod gemv;
pub(super) mod narrow;
pub(super) mod sink;
pub(super) mod tile;

use sink::{ArgMax, Finish, Max, Sink};
use tile::{Operands, Place, Tile, for_each_tile};

declare_kernels!(Neon, runs_here: true, {
    f32: Some(GEMM_F32),
    f16: None,
    i8: None,
    gemv_f32: gemv::gemv::<f32>,
    gemv_f16: gemv::gemv::<half::f16>,
    gemv_i8: gemv::gemv::<i8>,
    narrow_f16: narrow::to_f16,
    narrow_i8: narrow::to_i8,
    fps_step: fps::step,
});

/// Inputs of one round of the tile's loop.
const STEP: usize = 4;

/// The products that all NEON files offer in fp32.
pub(super) const GEMM_F32: Gemm<f32, f32, f32> =
    Gemm { nr: 8, k_step: STEP, rows: f32_rows, max: f32_max, argmax: f32_argmax };

fn f32_rows(
    rows: &Rows<'_, f32>,
    weights: &Panels<f32>,
    panels: Range<usize>,
    out: &mut [f32],
    out_stride: usize,
) {
    for_each_tile::<F32, _, 2>(rows, weights, panels, Finish::new(weights, out, out_stride));
}

fn f32_max(rows: &Rows<'_, f32>, weights: &Panels<f32>, panels: Range<usize>, maxima: &mut [f32]) {
    let first_panel = panels.start;
    for_each_tile::<F32, _, 2>(rows, weights, panels, Max { first_panel, maxima });
}

fn f32_argmax(
    rows: &Rows<'_, f32>,
    weights: &Panels<f32>,
    panels: Range<usize>,
    first_row: u32,
    maxima: &mut [f32],
    winners: &mut [u32],
) {
    let sink = ArgMax { max: Max { first_panel: panels.start, maxima }, first_row, winners };
    for_each_tile::<F32, _, 2>(rows, weights, panels, sink);
}

struct F32;

impl Tile<2> for F32 {
    type Activation = f32;
    type Weight = f32;
    type Sums = float32x4_t;
    const STEP: usize = STEP;

    unsafe fn run<S: Sink<float32x4_t, 2>, const R: usize>(
        operands: Operands<f32, f32>,
        place: Place,
        sink: &mut S,
    ) {
        // SAFETY: the caller vouches for the operands; NEON is on every aarch64.
        unsafe { tile_f32_8x8::<S, R>(operands, place, sink) }
    }
}

/// # Safety
/// As [`Tile::run`].
#[inline(never)]
#[target_feature(enable = "neon")]
unsafe fn tile_f32_8x8<S: Sink<float32x4_t, 2>, const R: usize>(
    operands: Operands<f32, f32>,
    place: Place,
    sink: &mut S,
) {
    let Operands { rows, stride, weights, inputs } = operands;
    let mut sums = [[vdupq_n_f32(0.0); 2]; R];
    let mut k = 0;
    while k < inputs {
        // SAFETY: `inputs` is a multiple of STEP, so inputs k to k + 3 of R
        // rows and 8 weights for each are there.
        unsafe {
            let a = from_fn(|r| vld1q_f32(rows.add(r * stride + k)));
            add_input::<0, R>(&mut sums, &a, weights.add(k * 8));
            add_input::<1, R>(&mut sums, &a, weights.add(k * 8 + 8));
            add_input::<2, R>(&mut sums, &a, weights.add(k * 8 + 16));
            add_input::<3, R>(&mut sums, &a, weights.add(k * 8 + 24));
        }
        k += STEP;
    }
    sink.take(place, &sums);
}

/// Adds the products of one input, which is lane `LANE` of the activations.
///
/// # Safety
/// There are 8 weights.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn add_input<const LANE: i32, const R: usize>(
    sums: &mut [[float32x4_t; 2]; R],
    a: &[float32x4_t; R],
    weights: *const f32,
) {
    // SAFETY: there are 8 weights.
    let w = unsafe { [vld1q_f32(weights), vld1q_f32(weights.add(4))] };
    for (sums, &a) in sums.iter_mut().zip(a) {
        sums[0] = vfmaq_laneq_f32::<LANE>(sums[0], w[0], a);
        sums[1] = vfmaq_laneq_f32::<LANE>(sums[1], w[1], a);
    }
}
