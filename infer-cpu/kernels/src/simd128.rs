//! WebAssembly's vectors of 128 bits: tiles of 4 rows by 8 channels, whose sums take 8 of the 16
//! registers that x86-64 has for them. See [`crate::loops`] for the loops.
//!
//! There is no fused multiply-add: products are rounded before they are added.

use std::arch::wasm32::*;

use crate::loops::{Lanes, Vector, implement};

crate::loops::declare!(
    Simd128, Floats, "simd128",
    runs_here: true,
    fused: false, prefilters: false
);

/// Four f32.
#[derive(Clone, Copy)]
struct Floats(v128);

/// Four i32.
#[derive(Clone, Copy)]
struct Ints(v128);

implement!(Vector for Floats {
    type Element = f32;
    type Float = Floats;
    type Int = Ints;
    fn splat(value: f32) -> Self = Self(f32x4_splat(value));
    fn load(from: *const f32) -> Self = Self(v128_load(from.cast()));
    fn store(self, to: *mut f32) = v128_store(to.cast(), self.0);
    fn add(self, other: Self) -> Self = Self(f32x4_add(self.0, other.0));
    // `pmax` and `pmin` return their first operand if either is NaN.
    fn max(self, other: Self) -> Self = Self(f32x4_pmax(other.0, self.0));
    fn keep_greater(self, best: &mut Self, who: &mut Self::Int, index: Self::Int) = {
        let greater = f32x4_gt(self.0, best.0);
        best.0 = v128_bitselect(self.0, best.0, greater);
        who.0 = v128_bitselect(index.0, who.0, greater)
    };
    fn to_float(self) -> Self = self;
});

implement!(Vector for Ints {
    type Element = i32;
    type Float = Floats;
    type Int = Ints;
    fn splat(value: i32) -> Self = Self(i32x4_splat(value));
    fn load(from: *const i32) -> Self = Self(v128_load(from.cast()));
    fn store(self, to: *mut i32) = v128_store(to.cast(), self.0);
    fn add(self, other: Self) -> Self = Self(i32x4_add(self.0, other.0));
    fn max(self, other: Self) -> Self = Self(i32x4_max(self.0, other.0));
    fn keep_greater(self, best: &mut Self, who: &mut Self, index: Self) = {
        let greater = i32x4_gt(self.0, best.0);
        best.0 = v128_bitselect(self.0, best.0, greater);
        who.0 = v128_bitselect(index.0, who.0, greater)
    };
    fn to_float(self) -> Self::Float = Floats(f32x4_convert_i32x4(self.0));
});

implement!(Lanes for Floats {
    const N = 4;
    const ROWS = 4;
    fn load_i8(from: *const i8) -> Self = {
        let bytes = v128_load32_zero(from.cast());
        Self(f32x4_convert_i32x4(i32x4_extend_low_i16x8(i16x8_extend_low_i8x16(bytes))))
    };
    fn store_u8(self, to: *mut u8) = {
        let ints = i32x4_trunc_sat_f32x4(self.0);
        let words = i16x8_narrow_i32x4(ints, ints);
        v128_store32_lane::<0>(u8x16_narrow_i16x8(words, words), to.cast())
    };
    fn fma(self, factor: Self, term: Self) -> Self =
        Self(f32x4_add(f32x4_mul(self.0, factor.0), term.0));
    fn mul(self, other: Self) -> Self = Self(f32x4_mul(self.0, other.0));
    fn sub(self, other: Self) -> Self = Self(f32x4_sub(self.0, other.0));
    fn min(self, other: Self) -> Self = Self(f32x4_pmin(other.0, self.0));
    fn round(self) -> Self = Self(f32x4_nearest(self.0));
    fn greater(self, other: Self) -> u32 = i32x4_bitmask(f32x4_gt(self.0, other.0)).into();
    fn total(self) -> f32 = {
        let two = f32x4_add(self.0, i32x4_shuffle::<2, 3, 2, 3>(self.0, self.0));
        f32x4_extract_lane::<0>(two) + f32x4_extract_lane::<1>(two)
    };
    fn dot4(sum: Self::Int, a: Self::Int, w: Self::Int) -> Self::Int = {
        let (low_a, low_w) = (i16x8_extend_low_i8x16(a.0), i16x8_extend_low_i8x16(w.0));
        let (high_a, high_w) = (i16x8_extend_high_i8x16(a.0), i16x8_extend_high_i8x16(w.0));
        let (low, high) = (i32x4_dot_i16x8(low_a, low_w), i32x4_dot_i16x8(high_a, high_w));
        // Each lane has two products of its group of four.
        let (even, odd) =
            (i32x4_shuffle::<0, 2, 4, 6>(low, high), i32x4_shuffle::<1, 3, 5, 7>(low, high));
        Ints(i32x4_add(sum.0, i32x4_add(even, odd)))
    };
});
