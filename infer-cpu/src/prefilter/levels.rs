//! A block's activations in 128 levels.

use std::ops::RangeInclusive;

use crate::kernel::{I8_LARGEST, Kernels, LevelSums, Rows};

/// Largest activations that divisions by their step leave finite and normal.
const ORDINARY: RangeInclusive<f32> = 1e-15..=1e15;

/// Levels of some rows.
#[derive(Default)]
pub struct Levels {
    /// A level for each activation.
    pub bytes: Vec<u8>,
    /// Between two levels.
    pub step: f32,
    /// The largest Euclidean norm of a row's levels.
    pub norm: f32,
    /// The largest Euclidean norm of what rounding took from a row, in levels.
    pub lost: f32,
}

impl Levels {
    /// Room for `n` activations.
    pub fn with_room(n: usize) -> Self {
        Self { bytes: vec![0; n], ..Self::default() }
    }

    /// Takes the levels of `rows`, whole ones, and returns whether there are
    /// any: not of activations below 0, of none above 0 and of extreme ones.
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

/// The smallest and the largest of `values`, whole rows, or 0. NaN is passed over.
fn extremes(values: &[f32]) -> (f32, f32) {
    const LANES: usize = 16;
    let (mut least, mut largest) = ([0.0f32; LANES], [0.0f32; LANES]);
    // Rows are multiples of a vector's width: nothing is left over.
    for chunk in values.as_chunks::<LANES>().0 {
        for lane in 0..LANES {
            let value = chunk[lane];
            least[lane] = if value < least[lane] { value } else { least[lane] };
            largest[lane] = if value > largest[lane] { value } else { largest[lane] };
        }
    }
    (least.into_iter().fold(0.0, f32::min), largest.into_iter().fold(0.0, f32::max))
}
