//! AVX2 with FMA: tiles of 6 rows by 16 channels, whose sums take 12 of the 16 registers.
//! See [`crate::loops`] for the loops.

use std::arch::x86_64::*;

use crate::loops::{Lanes, Vector, implement};

crate::loops::declare!(
    Avx2, __m256, "avx2,fma",
    runs_here: is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
    fused: true, prefilters: false
);

implement!(Vector for __m256 {
    type Element = f32;
    type Float = __m256;
    type Int = __m256i;
    fn splat(value: f32) -> Self = _mm256_set1_ps(value);
    fn load(from: *const f32) -> Self = _mm256_loadu_ps(from);
    fn store(self, to: *mut f32) = _mm256_storeu_ps(to, self);
    fn add(self, other: Self) -> Self = _mm256_add_ps(self, other);
    fn max(self, other: Self) -> Self = _mm256_max_ps(self, other);
    fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int) = {
        // An ordered comparison: NaN is never greater.
        let greater = _mm256_cmp_ps::<_CMP_GT_OQ>(self, *best);
        *best = _mm256_blendv_ps(*best, self, greater);
        *who = _mm256_blendv_epi8(*who, index, _mm256_castps_si256(greater))
    };
    fn to_float(self) -> Self = self;
});

implement!(Vector for __m256i {
    type Element = i32;
    type Float = __m256;
    type Int = __m256i;
    fn splat(value: i32) -> Self = _mm256_set1_epi32(value);
    fn load(from: *const i32) -> Self = _mm256_loadu_si256(from.cast());
    fn store(self, to: *mut i32) = _mm256_storeu_si256(to.cast(), self);
    fn add(self, other: Self) -> Self = _mm256_add_epi32(self, other);
    fn max(self, other: Self) -> Self = _mm256_max_epi32(self, other);
    fn keep_greater(self, best: &mut Self, who: &mut Self, index: Self) = {
        let greater = _mm256_cmpgt_epi32(self, *best);
        *best = _mm256_blendv_epi8(*best, self, greater);
        *who = _mm256_blendv_epi8(*who, index, greater)
    };
    fn to_float(self) -> Self::Float = _mm256_cvtepi32_ps(self);
});

implement!(Lanes for __m256 {
    const N = 8;
    const ROWS = 6;
    fn load_i8(from: *const i8) -> Self =
        _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(from.cast())));
    fn store_u8(self, to: *mut u8) = {
        let ints = _mm256_cvtps_epi32(self);
        // Packing works within halves of 128 bits, so both halves are packed into one.
        let words =
            _mm_packs_epi32(_mm256_castsi256_si128(ints), _mm256_extracti128_si256::<1>(ints));
        _mm_storel_epi64(to.cast(), _mm_packus_epi16(words, words))
    };
    fn fma(self, factor: Self, term: Self) -> Self = _mm256_fmadd_ps(self, factor, term);
    fn mul(self, other: Self) -> Self = _mm256_mul_ps(self, other);
    fn sub(self, other: Self) -> Self = _mm256_sub_ps(self, other);
    fn min(self, other: Self) -> Self = _mm256_min_ps(self, other);
    fn round(self) -> Self =
        _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self);
    fn greater(self, other: Self) -> u32 =
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self, other)) as u32;
    fn total(self) -> f32 = {
        let four = _mm_add_ps(_mm256_castps256_ps128(self), _mm256_extractf128_ps::<1>(self));
        let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
    };
    fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int = {
        // Two products of at most 127 * 127 fit into 16 bits, so nothing saturates.
        let pairs = _mm256_maddubs_epi16(a, w);
        _mm256_add_epi32(sum, _mm256_madd_epi16(pairs, _mm256_set1_epi16(1)))
    };
});
