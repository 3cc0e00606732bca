//! Safe vectors of four lanes, for code that several formats share.

use std::arch::aarch64::*;
use std::array::from_fn;

/// Four numbers in a register.
pub trait Lanes: Copy {
    /// The number in a lane.
    type Element: Copy;
    fn splat(value: Self::Element) -> Self;
    fn load(from: &[Self::Element; 4]) -> Self;
    fn store(self, to: &mut [Self::Element; 4]);
    /// `other` where `mask` is all ones.
    fn replaced(self, mask: uint32x4_t, other: Self) -> Self;
}

/// Four sums in a register.
pub trait Sums: Lanes {
    /// The larger number of each lane; NaN does not count.
    fn larger(self, than: Self) -> Self;
    /// All ones in lanes where `self` is larger than `other`.
    fn exceeds(self, other: Self) -> uint32x4_t;
    fn to_f32(self) -> float32x4_t;
}

macro_rules! lanes {
    ($vector:ty, $element:ty, $splat:ident, $load:ident, $store:ident, $select:ident) => {
        impl Lanes for $vector {
            type Element = $element;

            #[inline(always)]
            fn splat(value: $element) -> Self {
                // SAFETY: NEON is on every aarch64.
                unsafe { $splat(value) }
            }

            #[inline(always)]
            fn load(from: &[$element; 4]) -> Self {
                // SAFETY: the array has four elements. NEON is on every aarch64.
                unsafe { $load(from.as_ptr()) }
            }

            #[inline(always)]
            fn store(self, to: &mut [$element; 4]) {
                // SAFETY: the array has four elements. NEON is on every aarch64.
                unsafe { $store(to.as_mut_ptr(), self) }
            }

            #[inline(always)]
            fn replaced(self, mask: uint32x4_t, other: Self) -> Self {
                // SAFETY: NEON is on every aarch64.
                unsafe { $select(mask, other, self) }
            }
        }
    };
}

lanes!(float32x4_t, f32, vdupq_n_f32, vld1q_f32, vst1q_f32, vbslq_f32);
lanes!(int32x4_t, i32, vdupq_n_s32, vld1q_s32, vst1q_s32, vbslq_s32);
lanes!(uint32x4_t, u32, vdupq_n_u32, vld1q_u32, vst1q_u32, vbslq_u32);

macro_rules! sums {
    ($vector:ty, $larger:ident, $exceeds:ident, $to_f32:expr) => {
        impl Sums for $vector {
            #[inline(always)]
            fn larger(self, than: Self) -> Self {
                // SAFETY: NEON is on every aarch64.
                unsafe { $larger(self, than) }
            }

            #[inline(always)]
            fn exceeds(self, other: Self) -> uint32x4_t {
                // SAFETY: NEON is on every aarch64.
                unsafe { $exceeds(self, other) }
            }

            #[inline(always)]
            fn to_f32(self) -> float32x4_t {
                $to_f32(self)
            }
        }
    };
}

sums!(float32x4_t, vmaxnmq_f32, vcgtq_f32, std::convert::identity);
sums!(int32x4_t, vmaxq_s32, vcgtq_s32, |sums| {
    // SAFETY: NEON is on every aarch64.
    unsafe { vcvtq_f32_s32(sums) }
});

/// The first `V` vectors of a slice.
#[inline(always)]
pub fn load<L: Lanes, const V: usize>(from: &[L::Element]) -> [L; V] {
    let (from, _) = from[..4 * V].as_chunks();
    from_fn(|v| L::load(&from[v]))
}

/// Writes `V` vectors to the beginning of a slice.
#[inline(always)]
pub fn store<L: Lanes, const V: usize>(vectors: [L; V], to: &mut [L::Element]) {
    let (to, _) = to[..4 * V].as_chunks_mut();
    for (vector, to) in vectors.into_iter().zip(to) {
        vector.store(to);
    }
}
