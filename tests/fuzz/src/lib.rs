//! The code under fuzz, compiled here so that neither wgpu nor the rest of
//! sim-gpu has to be built with coverage flags.
//!
//! There is no nightly compiler to rely on; a stable one takes the same flags:
//!
//! ```text
//! cd tests/fuzz
//! RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
//!   -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
//!   -Cllvm-args=-sanitizer-coverage-pc-table \
//!   -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1" \
//!   cargo run --release --target x86_64-unknown-linux-gnu --bin off -- \
//!   -max_total_time=20
//! ```
//!
//! The target is named so that build scripts go without the flags.

#[path = "../../../sim-gpu/src/mesh/mod.rs"]
pub mod mesh;
