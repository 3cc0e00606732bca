//! Pooled products for training.

use crate::{Gemm, Panels, Rows, fastest};

/// Weights `[outputs, inputs]` in fp32, packed for the fastest kernels of this machine. Their
/// products with points are pooled and never stored.
pub struct PooledProducts {
    gemm: &'static Gemm<f32, f32, f32>,
    panels: Panels<f32>,
}

impl PooledProducts {
    /// Packs the weights `weight(input, output)`.
    ///
    /// # Panics
    /// If there are no inputs, or more weights than fit in memory.
    #[must_use]
    pub fn new(inputs: usize, outputs: usize, weight: impl Fn(usize, usize) -> f32) -> Self {
        assert!(inputs > 0, "expected points of one coordinate or more, found 0");
        let gemm = &fastest().f32;
        let mut panels = Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, 1));
        panels.fill(weight);
        Self { gemm, panels }
    }

    /// Raises `maxima` `[outputs]` to the largest products over `points` `[n, inputs]` in C order,
    /// and sets the `winners` `[outputs]` of raised maxima to the first points that attain them,
    /// counted from `first_row`. NaN does not count.
    ///
    /// # Panics
    /// If `points` are not whole rows, or if `maxima` or `winners` do not have one element per
    /// output.
    pub fn argmax(&self, points: &[f32], first_row: u32, maxima: &mut [f32], winners: &mut [u32]) {
        let Self { gemm, panels } = self;
        let (inputs, stride) = (panels.inputs(), panels.padded_inputs());
        assert!(points.len().is_multiple_of(inputs), "expected whole points of {inputs} inputs");
        let expected = (panels.outputs(), panels.outputs());
        assert_eq!((maxima.len(), winners.len()), expected, "expected a maximum for each output");
        let n = points.len() / inputs;
        // Kernels read whole steps of inputs, so rows are padded with zeros.
        let mut rows = vec![0.0; n * stride];
        for (row, point) in rows.chunks_exact_mut(stride).zip(points.chunks_exact(inputs)) {
            row[..inputs].copy_from_slice(point);
        }
        let padded = panels.padded_outputs();
        // Kernels write whole panels, so outputs are padded, too.
        let mut padded_maxima = vec![f32::NEG_INFINITY; padded];
        let mut padded_winners = vec![first_row; padded];
        padded_maxima[..maxima.len()].copy_from_slice(maxima);
        padded_winners[..winners.len()].copy_from_slice(winners);
        (gemm.argmax)(
            &Rows::new(&rows, stride, n),
            panels,
            0..panels.n_panels(),
            first_row,
            &mut padded_maxima,
            &mut padded_winners,
        );
        maxima.copy_from_slice(&padded_maxima[..maxima.len()]);
        winners.copy_from_slice(&padded_winners[..winners.len()]);
    }
}
