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
//! It is the tile of fp32 with a group of four inputs in place of one: SDOT reads a group of
//! activations by element and adds its four products with each of four channels. Activations have
//! seven bits, so they are valid signed bytes.

use std::arch::aarch64::*;
use std::arch::{asm, is_aarch64_feature_detected};

use crate::neon::NEON;
use crate::neon::sink::Sink;
use crate::neon::tile::{Feed, Strip, Tile, VECTOR_BYTES, gemm, tile_8x8};
use crate::table::declare_kernels;

declare_kernels!(NeonDot, runs_here: is_aarch64_feature_detected!("dotprod"), {
    i8: Some(gemm::<I8, 2>()),
    prefilters: true,
    ..NEON
});

tile_8x8! {
    I8: [u8; i8] -> int32x4_t, "neon,dotprod", fn tile_i8_8x8,
    zero: vdupq_n_s32(0), load: vld1q_s8 -> int8x16_t, multiply_add: sdot
}

/// The instruction SDOT, which the standard library does not offer yet.
#[inline]
#[target_feature(enable = "neon,dotprod")]
fn sdot<const LANE: i32>(mut sums: int32x4_t, w: int8x16_t, a: int8x16_t) -> int32x4_t {
    // SAFETY: the instruction changes only `sums`; `target_feature` ensures that it exists.
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
