//! NEON in fp32, and what all three NEON files share.
//!
//! The register tile, 8 rows by 8 channels:
//!
//! ```text
//!                       w[0] channels 0-3   w[1] channels 4-7
//!
//! a[0]  inputs k..k+4   sums[0][0]          sums[0][1]
//! a[1]                  sums[1][0]          sums[1][1]
//! ...                   ...                 ...
//! a[7]                  sums[7][0]          sums[7][1]
//! ```
//!
//! 16 sums are twice what two pipes of latency 4 need. 8 registers hold 4
//! inputs of each row, which FMLA reads by element, 2 the weights of the input
//! at hand; 6 of the 32 are left for weights under way. 4 inputs take 16
//! vectors loaded for 64 FMLA. A taller tile would leave no room for its
//! activations, or need them packed.

use std::arch::aarch64::*;

use super::{KernelName, Kernels, declare_kernels};
use crate::edge_conv::EdgeConv;

mod fps;
mod gemv;
pub(super) mod lanes;
mod narrow;
mod prefilter;
pub(super) mod sink;
pub(super) mod tile;

use sink::Sink;
use tile::{Feed, Strip, Tile, VECTOR_BYTES};

declare_kernels!(Neon, runs_here: true, { ..NEON });

/// What all NEON files offer.
pub(super) const NEON: Kernels = Kernels {
    name: KernelName::Neon,
    f32: Some(tile::gemm::<F32, 2>()),
    f16: None,
    i8: None,
    prefilters: false,
    prefilter: prefilter::PREFILTER,
    gemv_f32: gemv::gemv::<f32>,
    gemv_f16: gemv::gemv::<half::f16>,
    gemv_i8: gemv::gemv::<i8>,
    narrow_f16: narrow::to_f16,
    narrow_i8: narrow::to_i8,
    fps_step: fps::step,
    edge_features: EdgeConv::features::<true>,
};

struct F32;

impl Tile<2> for F32 {
    type Activation = f32;
    type Weight = f32;
    type Sums = float32x4_t;
}

impl<S: Sink<float32x4_t, 2>> Feed<S, 2> for F32 {
    unsafe fn feed<const R: usize>(strip: &Strip<f32, f32>, sink: &mut S) {
        // SAFETY: the contract of `Feed::feed`; NEON is on every aarch64.
        unsafe { tile_f32_8x8::<S, R>(strip, sink) }
    }
}

/// # Safety
/// As [`Feed::feed`].
#[inline(never)]
#[target_feature(enable = "neon")]
unsafe fn tile_f32_8x8<S: Sink<float32x4_t, 2>, const R: usize>(
    strip: &Strip<f32, f32>,
    sink: &mut S,
) {
    let mut rows: [*const f32; R] = strip.first_rows();
    for _ in 0..strip.n_tiles {
        let mut sums = [[vdupq_n_f32(0.0); 2]; R];
        let (mut weights, mut at) = (strip.weights, 0);
        while at < strip.row_bytes() {
            // SAFETY: 4 inputs of R rows are there, and 8 weights for each.
            unsafe {
                let a = rows.map(|row| vld1q_f32(row.byte_add(at)));
                add_input::<0, R>(&mut sums, &a, weights);
                add_input::<1, R>(&mut sums, &a, weights.add(8));
                add_input::<2, R>(&mut sums, &a, weights.add(16));
                add_input::<3, R>(&mut sums, &a, weights.add(24));
                weights = weights.add(32);
            }
            at += VECTOR_BYTES;
        }
        // SAFETY: the sink has room for the strip's rows, by the contract of `Feed::feed`.
        unsafe { sink.take(sums) };
        rows = strip.next_rows(rows);
    }
}

/// Adds the products of the input that is lane `LANE` of the activations.
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
    // SAFETY: this function's contract.
    let w = unsafe { [vld1q_f32(weights), vld1q_f32(weights.add(4))] };
    for (sums, &a) in sums.iter_mut().zip(a) {
        sums[0] = vfmaq_laneq_f32::<LANE>(sums[0], w[0], a);
        sums[1] = vfmaq_laneq_f32::<LANE>(sums[1], w[1], a);
    }
}
