//! What becomes of a tile's sums while they are in registers: outputs, or
//! maxima over rows, so that the widest features are never stored.

use std::arch::aarch64::*;
use std::array::from_fn;

use super::super::Panels;
use super::tile::Place;

/// Takes tiles of `V` vectors a row.
pub trait Sink<L, const V: usize> {
    /// Takes the sums of `R` rows by one panel.
    fn take<const R: usize>(&mut self, place: Place, sums: &[[L; V]; R]);
}

/// Writes scaled sums with bias and ReLU.
pub struct Finish<'a> {
    scale: &'a [f32],
    bias: &'a [f32],
    /// What outputs are raised to: 0, or NaN, which FMAXNM ignores.
    floor: f32,
    out: &'a mut [f32],
    out_stride: usize,
}

impl<'a> Finish<'a> {
    pub fn new<W>(weights: &'a Panels<W>, out: &'a mut [f32], out_stride: usize) -> Self {
        let floor = if weights.relu { 0.0 } else { f32::NAN };
        Self { scale: &weights.scale, bias: &weights.bias, floor, out, out_stride }
    }
}

impl<L: Sums, const V: usize> Sink<L, V> for Finish<'_> {
    #[inline(always)]
    fn take<const R: usize>(&mut self, place: Place, sums: &[[L; V]; R]) {
        let channel = place.panel * 4 * V;
        let bias: [float32x4_t; V] = load(&self.bias[channel..]);
        let scale: [float32x4_t; V] = match self.scale {
            [] => [float32x4_t::splat(1.0); V],
            scale => load(&scale[channel..]),
        };
        let floor = float32x4_t::splat(self.floor);
        for (r, sums) in sums.iter().enumerate() {
            let outputs: [float32x4_t; V] = from_fn(|v| {
                // SAFETY: NEON is on every aarch64.
                unsafe { vmaxnmq_f32(vfmaq_f32(bias[v], sums[v].to_f32(), scale[v]), floor) }
            });
            store(outputs, &mut self.out[(place.row + r) * self.out_stride + channel..]);
        }
    }
}

/// Raises maxima to the largest sums.
pub struct Max<'a, C> {
    /// The panel of the first maximum.
    pub first_panel: usize,
    /// One a channel.
    pub maxima: &'a mut [C],
}

impl<L: Sums, const V: usize> Sink<L, V> for Max<'_, L::Element> {
    #[inline(always)]
    fn take<const R: usize>(&mut self, place: Place, sums: &[[L; V]; R]) {
        let maxima = &mut self.maxima[(place.panel - self.first_panel) * 4 * V..];
        let mut largest: [L; V] = load(maxima);
        for sums in sums {
            largest = from_fn(|v| largest[v].larger(sums[v]));
        }
        store(largest, maxima);
    }
}

/// Raises maxima to the largest sums and remembers whose they are.
pub struct ArgMax<'a, C> {
    /// The maxima.
    pub max: Max<'a, C>,
    /// What the first row counts as.
    pub first_row: u32,
    /// One a channel.
    pub winners: &'a mut [u32],
}

impl<L: Sums, const V: usize> Sink<L, V> for ArgMax<'_, L::Element> {
    #[inline(always)]
    fn take<const R: usize>(&mut self, place: Place, sums: &[[L; V]; R]) {
        let channel = (place.panel - self.max.first_panel) * 4 * V;
        let (maxima, winners) = (&mut self.max.maxima[channel..], &mut self.winners[channel..]);
        let mut largest: [L; V] = load(maxima);
        let mut winner: [uint32x4_t; V] = load(winners);
        for (r, sums) in sums.iter().enumerate() {
            let row = uint32x4_t::splat(self.first_row + (place.row + r) as u32);
            for v in 0..V {
                let raised = sums[v].exceeds(largest[v]);
                largest[v] = largest[v].replaced(raised, sums[v]);
                winner[v] = winner[v].replaced(raised, row);
            }
        }
        store(largest, maxima);
        store(winner, winners);
    }
}

/// The first `V` vectors of a slice.
#[inline(always)]
fn load<L: Lanes, const V: usize>(from: &[L::Element]) -> [L; V] {
    let (from, _) = from[..4 * V].as_chunks();
    from_fn(|v| L::load(&from[v]))
}

/// Writes `V` vectors to the beginning of a slice.
#[inline(always)]
fn store<L: Lanes, const V: usize>(vectors: [L; V], to: &mut [L::Element]) {
    let (to, _) = to[..4 * V].as_chunks_mut();
    for (vector, to) in vectors.into_iter().zip(to) {
        vector.store(to);
    }
}

/// Four numbers in a register.
pub trait Lanes: Copy {
    /// One of them.
    type Element: Copy;
    /// Four times the same.
    fn splat(value: Self::Element) -> Self;
    /// Reads four.
    fn load(from: &[Self::Element; 4]) -> Self;
    /// Writes four.
    fn store(self, to: &mut [Self::Element; 4]);
    /// `other` where `mask` is all ones.
    fn replaced(self, mask: uint32x4_t, other: Self) -> Self;
}

/// Four sums in a register.
pub trait Sums: Lanes {
    /// Lane by lane the larger number; of a number and NaN the number.
    fn larger(self, than: Self) -> Self;
    /// All ones where this is larger than `other`.
    fn exceeds(self, other: Self) -> uint32x4_t;
    /// The nearest numbers of fp32.
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
                // SAFETY: four elements are there.
                unsafe { $load(from.as_ptr()) }
            }

            #[inline(always)]
            fn store(self, to: &mut [$element; 4]) {
                // SAFETY: there is room for four elements.
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

impl Sums for float32x4_t {
    #[inline(always)]
    fn larger(self, than: Self) -> Self {
        // SAFETY: NEON is on every aarch64.
        unsafe { vmaxnmq_f32(self, than) }
    }

    #[inline(always)]
    fn exceeds(self, other: Self) -> uint32x4_t {
        // SAFETY: NEON is on every aarch64.
        unsafe { vcgtq_f32(self, other) }
    }

    #[inline(always)]
    fn to_f32(self) -> float32x4_t {
        self
    }
}

impl Sums for int32x4_t {
    #[inline(always)]
    fn larger(self, than: Self) -> Self {
        // SAFETY: NEON is on every aarch64.
        unsafe { vmaxq_s32(self, than) }
    }

    #[inline(always)]
    fn exceeds(self, other: Self) -> uint32x4_t {
        // SAFETY: NEON is on every aarch64.
        unsafe { vcgtq_s32(self, other) }
    }

    #[inline(always)]
    fn to_f32(self) -> float32x4_t {
        // SAFETY: NEON is on every aarch64.
        unsafe { vcvtq_f32_s32(self) }
    }
}
