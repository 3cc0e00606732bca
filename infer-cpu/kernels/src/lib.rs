//! The hot loops, written by hand for each instruction set, behind a table of functions that is
//! chosen at run time.
//!
//! A layer multiplies rows of activations (one row per point) by a matrix that is packed into
//! `Panels` (a few output channels each). A register tile is a few rows by one panel: vector lanes
//! run along output channels, so that rows need no packing and the maximum over points is taken
//! lane by lane. `suite` tests every file against the reference, `scalar`.
//!
//! Kernels do not change the processor's mode for subnormal numbers. Flushing them to 0 changes a
//! sum of K products by at most K times 1.2e-38 (the least normal f32), which is negligible beside
//! activations that decide a class. Logits agree to 1e-33 in both modes, and to the bit in the same
//! mode; `infer-cpu/tests/flushed.rs` tests it.
//!
//! This is the lowest layer of `infer-cpu`, which re-exports what its users need; it has no stable
//! interface of its own.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]
#![allow(unsafe_code, reason = "SIMD intrinsics; every block says why it is sound")]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod choose;
mod dense;
mod edge_conv;
mod format;
#[cfg(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128")))]
mod loops;
mod neighbor_pool;
mod neighborhood;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(target_arch = "aarch64")]
mod neon_dot;
mod panels;
mod pooled;
mod prefilter;
mod rows;
mod scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
#[cfg(test)]
mod suite;
mod table;

pub use choose::{available, fastest};
pub use dense::Dense;
pub use edge_conv::{EdgeConv, EdgeScratch};
pub use format::{F32, Format, I8, Weight};
pub use neighbor_pool::{NeighborPool, PoolStep};
pub use neighborhood::{LANES, Lanes, Neighborhood, TILE, Tile};
pub use panels::Panels;
pub use pooled::PooledProducts;
pub use prefilter::{
    Best, GROUP, Int8Prefilter, Levels as PrefilterLevels, PrefilterScratch, prefilter_pays,
};
pub use rows::Rows;
pub use table::{
    ArgmaxKernel, EdgeFeatures, Gemm, Gemv, KernelName, Kernels, MaxKernel, PoolNeighbors,
    RowsKernel, Soa, Sum,
};

/// Output channels are padded to a multiple of this, so that a layer's outputs are whole vectors of
/// every kernel in the next layer.
pub const WIDTH_STEP: usize = 64;

/// Output channels of a panel for [`Gemv`]: 16 NEON registers of fp32.
pub const GEMV_NR: usize = 64;

/// The largest activation of an int8 layer: with seven bits, kernels for signed and for unsigned
/// activations accept the same bytes.
pub const I8_LARGEST: u8 = 127;
