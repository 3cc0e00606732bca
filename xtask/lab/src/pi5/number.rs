//! Formats of numbers, and how their kernels are known by their code.

use super::assembly::Loop;

/// A format that kernels multiply in, or that weights are stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// fp32.
    F32,
    /// fp16.
    F16,
    /// int8.
    I8,
}

impl Number {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::F32, Self::F16, Self::I8];

    /// Bytes of a number.
    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
            Self::I8 => 1,
        }
    }

    /// What tile functions of this format are called, up to their shape.
    pub fn tile_prefix(self) -> &'static str {
        match self {
            Self::F32 => "tile_f32_",
            Self::F16 => "tile_f16_",
            Self::I8 => "tile_i8_",
        }
    }

    /// The instruction that tiles of this format multiply by, the arrangement
    /// of its result, and its products.
    pub fn multiplier(self) -> (&'static str, &'static str, usize) {
        match self {
            Self::F32 => ("fmla", "4s", 4),
            Self::F16 => ("fmla", "8h", 8),
            Self::I8 => ("sdot", "4s", 16),
        }
    }

    /// Whether a loop of matrix-vector products widens weights of this format.
    pub fn widens(self, inner: &Loop<'_>) -> bool {
        let (f16, i8) = (inner.has("fcvtl"), inner.has("scvtf"));
        match self {
            Self::F32 => !f16 && !i8,
            Self::F16 => f16,
            Self::I8 => i8,
        }
    }
}
