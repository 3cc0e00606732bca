//! NEON in fp32, and the code that both NEON files share.
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
//! 16 sums are twice as many as two pipes of latency 4 need. 8 registers hold 4 inputs of each row,
//! which FMLA reads by element, and 2 hold the weights of the current input; 6 of the 32 remain for
//! weights in flight. 4 inputs take 16 vector loads for 64 FMLA. A taller tile would leave no
//! registers for activations, or need them packed.

use std::arch::aarch64::*;

use crate::edge_conv::EdgeConv;
use crate::neighbor_pool::NeighborPool;
use crate::table::{KernelName, Kernels, declare_kernels};

mod fps;
mod gemv;
mod lanes;
mod levels;
mod prefilter;
pub(super) mod sink;
pub(super) mod tile;

use sink::Sink;
use tile::{Feed, Strip, Tile, VECTOR_BYTES, tile_8x8};

declare_kernels!(Neon, runs_here: true, { ..NEON });

/// The table that the other NEON files extend.
pub(super) const NEON: Kernels = Kernels {
    name: KernelName::Neon,
    f32: tile::gemm::<F32, 2>(),
    i8: None,
    prefilters: false,
    prefilter: prefilter::PREFILTER,
    gemv_f32: gemv::gemv::<f32>,
    gemv_i8: gemv::gemv::<i8>,
    narrow_i8: levels::to_i8,
    fps_step: fps::step,
    edge_features: EdgeConv::features::<true>,
    pool_neighbors: NeighborPool::run::<true>,
};

tile_8x8! {
    F32: [f32; f32] -> float32x4_t, "neon", fn tile_f32_8x8,
    zero: vdupq_n_f32(0.0), load: vld1q_f32 -> float32x4_t, multiply_add: vfmaq_laneq_f32
}
