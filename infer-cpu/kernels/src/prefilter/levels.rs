//! The activations of a block, quantised to 128 levels.

use std::ops::RangeInclusive;

use crate::table::{Kernels, LevelSums};
use crate::{I8_LARGEST, Rows};

/// The range of largest activations for which quotients by the step are finite and normal.
const ORDINARY: RangeInclusive<f32> = 1e-15..=1e15;

/// The levels of a block of rows.
#[derive(Default)]
pub struct Levels {
    /// The level of each activation.
    pub(super) bytes: Vec<u8>,
    /// The difference between two levels.
    pub(super) step: f32,
    /// The largest Euclidean norm of a row's levels.
    pub(super) norm: f32,
    /// The largest Euclidean norm of a row's rounding errors, in levels.
    pub(super) lost: f32,
}

impl Levels {
    /// Memory for `n` activations.
    pub fn with_room(n: usize) -> Self {
        Self { bytes: vec![0; n], ..Self::default() }
    }

    /// Quantises `rows`, padding included. Returns false if an activation is negative, or if the
    /// largest one is 0 or extreme.
    pub fn take(&mut self, kernels: &Kernels, rows: &Rows<'_, f32>) -> bool {
        let values = &rows.data()[..rows.n() * rows.stride()];
        let (least, largest) = extremes(values);
        if least < 0.0 || !ORDINARY.contains(&largest) {
            return false;
        }
        self.step = largest / f32::from(I8_LARGEST);
        let mut most = LevelSums::default();
        let bytes = self.bytes.chunks_exact_mut(rows.stride());
        for (row, bytes) in values.chunks_exact(rows.stride()).zip(bytes) {
            let sums = (kernels.prefilter.levels)(row, 1.0 / self.step, bytes);
            most.lost = most.lost.max(sums.lost);
            most.squares = most.squares.max(sums.squares);
        }
        (self.norm, self.lost) = (most.squares.sqrt(), most.lost.sqrt());
        true
    }
}

/// The smallest and the largest of `values` and 0. NaN does not count.
fn extremes(values: &[f32]) -> (f32, f32) {
    const LANES: usize = 16;
    let (mut least, mut largest) = ([0.0f32; LANES], [0.0f32; LANES]);
    // Rows are multiples of a vector's width, so there is no remainder.
    for chunk in values.as_chunks::<LANES>().0 {
        for lane in 0..LANES {
            let value = chunk[lane];
            least[lane] = if value < least[lane] { value } else { least[lane] };
            largest[lane] = if value > largest[lane] { value } else { largest[lane] };
        }
    }
    (least.into_iter().fold(0.0, f32::min), largest.into_iter().fold(0.0, f32::max))
}
