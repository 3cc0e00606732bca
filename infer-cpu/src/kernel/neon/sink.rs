//! What becomes of a tile's sums: outputs, or maxima over rows, so that the
//! widest features are never stored.

use std::arch::aarch64::*;
use std::array::from_fn;

use super::super::Panels;
use super::lanes::{Lanes, Sums, load, store};
use super::tile::{Operands, Place, Sum, Tile};

/// Takes tile by tile.
pub trait Sink<T: Tile<V>, const V: usize> {
    /// Takes the sums of `R` rows by one panel.
    ///
    /// # Safety
    /// As [`Tile::sums`].
    unsafe fn take<const R: usize>(
        &mut self,
        operands: &Operands<T::Activation, T::Weight>,
        place: Place,
    );
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

impl<T: Tile<V>, const V: usize> Sink<T, V> for Finish<'_> {
    unsafe fn take<const R: usize>(
        &mut self,
        operands: &Operands<T::Activation, T::Weight>,
        place: Place,
    ) {
        // SAFETY: the caller's.
        let sums = unsafe { T::sums::<R>(operands) };
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

impl<T: Tile<V>, const V: usize> Sink<T, V> for Max<'_, Sum<T, V>> {
    unsafe fn take<const R: usize>(
        &mut self,
        operands: &Operands<T::Activation, T::Weight>,
        place: Place,
    ) {
        // SAFETY: the caller's.
        let largest = unsafe { T::largest::<R>(operands) };
        let maxima = &mut self.maxima[(place.panel - self.first_panel) * 4 * V..];
        let before: [T::Sums; V] = load(maxima);
        store(from_fn::<_, V, _>(|v| before[v].larger(largest[v])), maxima);
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

impl<T: Tile<V>, const V: usize> Sink<T, V> for ArgMax<'_, Sum<T, V>> {
    unsafe fn take<const R: usize>(
        &mut self,
        operands: &Operands<T::Activation, T::Weight>,
        place: Place,
    ) {
        // SAFETY: the caller's.
        let (largest, rows) = unsafe { T::first_largest::<R>(operands) };
        let channel = (place.panel - self.max.first_panel) * 4 * V;
        let (maxima, winners) = (&mut self.max.maxima[channel..], &mut self.winners[channel..]);
        let mut maximum: [T::Sums; V] = load(maxima);
        let mut winner: [uint32x4_t; V] = load(winners);
        let first_row = uint32x4_t::splat(self.first_row + place.row as u32);
        for v in 0..V {
            let raised = largest[v].exceeds(maximum[v]);
            maximum[v] = maximum[v].replaced(raised, largest[v]);
            // SAFETY: NEON is on every aarch64.
            let row = unsafe { vaddq_u32(first_row, rows[v]) };
            winner[v] = winner[v].replaced(raised, row);
        }
        store(maximum, maxima);
        store(winner, winners);
    }
}
