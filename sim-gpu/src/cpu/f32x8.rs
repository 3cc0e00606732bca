//! Eight numbers in f32 side by side, in a register of AVX.
//!
//! All functions are inlined into those of [`super::packet`] and so, in the end, into one
//! that enables the instructions: it is compiled for AVX2 and for AVX-512.

use bytemuck::must_cast;
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// How many numbers there are.
const LANES: usize = 8;

/// Eight numbers. To be used only where the processor has AVX2.
#[derive(Clone, Copy)]
pub struct F32x8(__m256);

/// For each of eight numbers whether something is so.
#[derive(Clone, Copy)]
pub struct Mask8(__m256);

macro_rules! operators {
    ($($of:ident: $operator:ident $name:ident $intrinsic:ident;)*) => {$(
        impl $operator for $of {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the processor has AVX2, as the type's users promise.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    )*};
}

operators! {
    F32x8: Add add _mm256_add_ps;
    F32x8: Sub sub _mm256_sub_ps;
    F32x8: Mul mul _mm256_mul_ps;
    F32x8: Div div _mm256_div_ps;
    Mask8: BitAnd bitand _mm256_and_ps;
    Mask8: BitOr bitor _mm256_or_ps;
}

impl From<[f32; LANES]> for F32x8 {
    #[inline(always)]
    fn from(numbers: [f32; LANES]) -> Self {
        Self(must_cast(numbers))
    }
}

impl From<F32x8> for [f32; LANES] {
    #[inline(always)]
    fn from(numbers: F32x8) -> Self {
        must_cast(numbers.0)
    }
}

impl F32x8 {
    pub const ZERO: Self = Self::splat(0.0);

    #[inline(always)]
    pub const fn splat(number: f32) -> Self {
        Self(must_cast([number; LANES]))
    }

    /// The smaller of each two, the second if one is not a number.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    /// The larger of each two, the second if one is not a number.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    pub fn negated(self) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe { _mm256_xor_ps(_mm256_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    pub fn cmplt(self, other: Self) -> Mask8 {
        self.compared::<_CMP_LT_OQ>(other)
    }

    #[inline(always)]
    pub fn cmple(self, other: Self) -> Mask8 {
        self.compared::<_CMP_LE_OQ>(other)
    }

    #[inline(always)]
    pub fn cmpeq(self, other: Self) -> Mask8 {
        self.compared::<_CMP_EQ_OQ>(other)
    }

    #[inline(always)]
    pub fn cmpne(self, other: Self) -> Mask8 {
        self.compared::<_CMP_NEQ_UQ>(other)
    }

    #[inline(always)]
    fn compared<const HOW: i32>(self, other: Self) -> Mask8 {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Mask8(unsafe { _mm256_cmp_ps::<HOW>(self.0, other.0) })
    }
}

impl Mask8 {
    /// Whether each of `indices` is above `index`; both below 2^31, or [`u32::MAX`], which is
    /// above none.
    #[inline(always)]
    pub fn above(indices: [u32; LANES], index: u32) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe {
            _mm256_castsi256_ps(_mm256_cmpgt_epi32(must_cast(indices), must_cast([index; LANES])))
        })
    }

    /// What is so here and not in `other`.
    #[inline(always)]
    pub fn without(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2, as the type's users promise.
        Self(unsafe { _mm256_andnot_ps(other.0, self.0) })
    }

    /// Of each two numbers the first where it is so, else the second.
    #[inline(always)]
    pub fn select(self, yes: F32x8, no: F32x8) -> F32x8 {
        // SAFETY: the processor has AVX2, as the type's users promise.
        F32x8(unsafe { _mm256_blendv_ps(no.0, yes.0, self.0) })
    }

    /// As [`select`](Self::select), of indices.
    #[inline(always)]
    pub fn select_index(self, yes: u32, no: [u32; LANES]) -> [u32; LANES] {
        must_cast(self.select(F32x8(must_cast([yes; LANES])), F32x8(must_cast(no))).0)
    }

    /// Where it is so, a bit each.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        // SAFETY: the processor has AVX2, as the type's users promise.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}
