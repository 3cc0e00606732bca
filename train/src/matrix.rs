//! Products of matrices on several threads. The order of each sum does not depend on the number of
//! threads.

use ndarray::linalg::general_mat_mul;
use ndarray::parallel::prelude::*;
use ndarray::{Array2, ArrayView2, Axis, s};
use rayon::slice::ParallelSliceMut;

/// A matrix, stored row by row.
pub type Matrix = Array2<f32>;

/// Number of rows that one thread takes at a time.
pub const ROWS: usize = 192;

/// Number of outputs whose gradients one thread computes at a time.
const COLUMNS: usize = 64;

/// `x` times `right`.
pub fn product(x: ArrayView2<'_, f32>, right: ArrayView2<'_, f32>) -> Matrix {
    let mut out = Matrix::zeros((x.nrows(), right.ncols()));
    out.axis_chunks_iter_mut(Axis(0), ROWS)
        .into_par_iter()
        .zip(x.axis_chunks_iter(Axis(0), ROWS))
        .for_each(|(mut out, x)| general_mat_mul(1.0, &x, &right, 0.0, &mut out));
    out
}

/// The transpose of `dz` `[n, outputs]` times `x` `[n, inputs]`: the gradient of the weights,
/// written to `out` `[outputs, inputs]` in C order.
pub fn gradient(dz: ArrayView2<'_, f32>, x: ArrayView2<'_, f32>, out: &mut [f32]) {
    let inputs = x.ncols();
    out.par_chunks_mut(COLUMNS * inputs).enumerate().for_each(|(chunk, out)| {
        let n = out.len() / inputs;
        let columns = dz.slice(s![.., chunk * COLUMNS..chunk * COLUMNS + n]);
        let mut out = ndarray::ArrayViewMut2::from_shape((n, inputs), out)
            .expect("invariant: a chunk is whole rows");
        general_mat_mul(1.0, &columns.t(), &x, 0.0, &mut out);
    });
}

/// The transpose of `left` `[n, k]` times `right` `[n, k]`, `[k, k]`.
pub fn square(left: ArrayView2<'_, f32>, right: ArrayView2<'_, f32>) -> Matrix {
    let k = right.ncols();
    let mut out = vec![0.0; k * k];
    gradient(left, right, &mut out);
    Matrix::from_shape_vec((k, k), out).expect("invariant: square")
}
