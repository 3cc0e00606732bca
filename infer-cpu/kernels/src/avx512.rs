//! AVX-512 with VNNI: tiles of 12 rows by 32 channels, whose sums take 24 of the 32 registers. See
//! [`crate::loops`] for the loops.
//!
//! VNNI is required: machines with AVX-512 but without VNNI (before Cascade Lake) use AVX2.

use std::arch::x86_64::*;

use crate::loops::{Lanes, Vector, implement};

crate::loops::declare!(
    Avx512, __m512, "avx512f,avx512bw,avx512vl,avx512vnni",
    runs_here: is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512vnni"),
    fused: true, prefilters: true
);

implement!(Vector for __m512 {
    type Element = f32;
    type Float = __m512;
    type Int = __m512i;
    fn splat(value: f32) -> Self = _mm512_set1_ps(value);
    fn load(from: *const f32) -> Self = _mm512_loadu_ps(from);
    fn store(self, to: *mut f32) = _mm512_storeu_ps(to, self);
    fn add(self, other: Self) -> Self = _mm512_add_ps(self, other);
    fn max(self, other: Self) -> Self = _mm512_max_ps(self, other);
    fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int) = {
        // An ordered comparison: NaN is never greater.
        let greater = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self, *best);
        *best = _mm512_mask_mov_ps(*best, greater, self);
        *who = _mm512_mask_mov_epi32(*who, greater, index)
    };
    fn to_float(self) -> Self = self;
});

implement!(Vector for __m512i {
    type Element = i32;
    type Float = __m512;
    type Int = __m512i;
    fn splat(value: i32) -> Self = _mm512_set1_epi32(value);
    fn load(from: *const i32) -> Self = _mm512_loadu_si512(from.cast());
    fn store(self, to: *mut i32) = _mm512_storeu_si512(to.cast(), self);
    fn add(self, other: Self) -> Self = _mm512_add_epi32(self, other);
    fn max(self, other: Self) -> Self = _mm512_max_epi32(self, other);
    fn keep_greater(self, best: &mut Self, who: &mut Self, index: Self) = {
        let greater = _mm512_cmpgt_epi32_mask(self, *best);
        *best = _mm512_mask_mov_epi32(*best, greater, self);
        *who = _mm512_mask_mov_epi32(*who, greater, index)
    };
    fn to_float(self) -> Self::Float = _mm512_cvtepi32_ps(self);
});

implement!(Lanes for __m512 {
    const N = 16;
    const ROWS = 12;
    fn load_i8(from: *const i8) -> Self =
        _mm512_cvtepi32_ps(_mm512_cvtepi8_epi32(_mm_loadu_si128(from.cast())));
    fn store_u8(self, to: *mut u8) =
        _mm_storeu_si128(to.cast(), _mm512_cvtepi32_epi8(_mm512_cvtps_epi32(self)));
    fn fma(self, factor: Self, term: Self) -> Self = _mm512_fmadd_ps(self, factor, term);
    fn mul(self, other: Self) -> Self = _mm512_mul_ps(self, other);
    fn sub(self, other: Self) -> Self = _mm512_sub_ps(self, other);
    fn min(self, other: Self) -> Self = _mm512_min_ps(self, other);
    fn round(self) -> Self = _mm512_roundscale_ps::<_MM_FROUND_TO_NEAREST_INT>(self);
    fn greater(self, other: Self) -> u32 = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self, other).into();
    fn total(self) -> f32 = _mm512_reduce_add_ps(self);
    fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int =
        _mm512_dpbusd_epi32(sum, a, w);
});
