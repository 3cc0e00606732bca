//! The choice of kernels at run time.

use crate::scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use crate::simd128;
use crate::table::{KernelName, Kernels};
#[cfg(target_arch = "x86_64")]
use crate::{avx2, avx512};
#[cfg(target_arch = "aarch64")]
use crate::{neon, neon_dot};

impl KernelName {
    /// Its kernels, if this machine can run them.
    #[must_use]
    pub fn kernels(self) -> Option<&'static Kernels> {
        match self {
            Self::Scalar => scalar::kernels(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::kernels(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::kernels(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => neon::kernels(),
            #[cfg(target_arch = "aarch64")]
            Self::NeonDot => neon_dot::kernels(),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => simd128::kernels(),
            #[allow(unreachable_patterns, reason = "each architecture leaves others out")]
            _ => None,
        }
    }
}

/// All kernels that this machine can run, the fastest first.
pub fn available() -> impl Iterator<Item = &'static Kernels> {
    // Names are in the order of speed on each architecture.
    KernelName::ALL.into_iter().rev().filter_map(KernelName::kernels)
}

/// The fastest kernels that this machine can run.
#[must_use]
pub fn fastest() -> &'static Kernels {
    available().next().expect("invariant: the scalar kernels run everywhere")
}
