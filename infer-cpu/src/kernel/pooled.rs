//! The products that a maximum over points takes, for whoever trains.

use super::{Gemm, Panels, Rows, fastest};

/// Weights `[outputs, inputs]` in fp32, packed for the fastest kernels of this
/// machine, whose products with points are pooled and never stored.
///
/// ```
/// use infer_cpu::kernel::PooledProducts;
///
/// // One output: the coordinate x.
/// let products = PooledProducts::new(3, 1, |input, _| if input == 0 { 1.0 } else { 0.0 });
/// let points = [0.5, 0.0, 0.0, 2.0, 0.0, 0.0];
/// let (mut maxima, mut winners) = ([f32::NEG_INFINITY], [0]);
/// products.argmax(&points, 10, &mut maxima, &mut winners);
/// assert_eq!((maxima, winners), ([2.0], [11]));
/// ```
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
        let gemm = fastest().f32.as_ref().expect("invariant: every set has fp32 products");
        let mut panels = Panels::zeros(inputs, outputs, (gemm.nr, gemm.k_step, 1));
        panels.fill(weight);
        Self { gemm, panels }
    }

    /// Raises each of `maxima` `[outputs]` to the largest product over
    /// `points` `[n, inputs]` in C order, and sets those of `winners`
    /// `[outputs]` to the first point that has it, counted from `first_row`.
    /// NaN raises nothing.
    ///
    /// # Panics
    /// If `points` are not whole rows, or `maxima` or `winners` are not as
    /// many as there are outputs.
    pub fn argmax(&self, points: &[f32], first_row: u32, maxima: &mut [f32], winners: &mut [u32]) {
        let Self { gemm, panels } = self;
        let (inputs, stride) = (panels.inputs(), panels.padded_inputs());
        assert!(points.len().is_multiple_of(inputs), "expected whole points of {inputs} inputs");
        let expected = (panels.outputs(), panels.outputs());
        assert_eq!((maxima.len(), winners.len()), expected, "expected a maximum for each output");
        let n = points.len() / inputs;
        let mut rows = vec![0.0; n * stride];
        for (row, point) in rows.chunks_exact_mut(stride).zip(points.chunks_exact(inputs)) {
            row[..inputs].copy_from_slice(point);
        }
        let padded = panels.padded_outputs();
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
