//! The transforms that T-Nets predict, one for each cloud.

use ndarray::parallel::prelude::*;
use ndarray::{ArrayView2, Axis, s};

use crate::matrix::Matrix;
use crate::rows::{Rows, by_cloud};

/// Square transforms T, `[clouds, k * k]`, which map a row vector p to p T.
#[derive(Clone, Debug, Default)]
pub struct Transforms {
    /// The elements of each cloud's transform, row by row.
    pub elements: Matrix,
    /// The number of rows of each transform.
    pub k: usize,
}

impl Transforms {
    /// The transforms whose differences from the identity are `elements`.
    #[must_use]
    pub fn around_identity(mut elements: Matrix, k: usize) -> Self {
        for i in 0..k {
            elements.column_mut(i * k + i).iter_mut().for_each(|x| *x += 1.0);
        }
        Self { elements, k }
    }

    /// The transform of cloud `cloud`, `[k, k]`.
    fn matrix(&self, cloud: usize) -> ArrayView2<'_, f32> {
        let row = self.elements.row(cloud).to_slice().expect("invariant: rows are contiguous");
        ArrayView2::from_shape((self.k, self.k), row).expect("invariant: k by k")
    }

    /// Applies to each row of `x` the transform of its cloud.
    #[must_use]
    pub fn forward(&self, x: ArrayView2<'_, f32>, rows: Rows<'_>) -> Matrix {
        let mut out = Matrix::zeros(x.dim());
        by_cloud(&mut out, rows).into_par_iter().enumerate().for_each(|(cloud, mut out)| {
            let x = x.slice(s![rows.starts[cloud]..rows.starts[cloud + 1], ..]);
            out.assign(&x.dot(&self.matrix(cloud)));
        });
        out
    }

    /// The gradients of the transforms' elements and of `x`, from the gradient `dy` of the
    /// transformed rows.
    #[must_use]
    pub fn backward(
        &self,
        x: ArrayView2<'_, f32>,
        dy: ArrayView2<'_, f32>,
        rows: Rows<'_>,
    ) -> (Matrix, Matrix) {
        let mut dx = Matrix::zeros(x.dim());
        let mut elements = Matrix::zeros(self.elements.dim());
        by_cloud(&mut dx, rows)
            .into_par_iter()
            .zip(elements.axis_iter_mut(Axis(0)))
            .enumerate()
            .for_each(|(cloud, (mut dx, mut elements))| {
                let range = s![rows.starts[cloud]..rows.starts[cloud + 1], ..];
                let (x, dy) = (x.slice(range), dy.slice(range));
                dx.assign(&dy.dot(&self.matrix(cloud).t()));
                let product = x.t().dot(&dy);
                elements.iter_mut().zip(&product).for_each(|(out, x)| *out = *x);
            });
        (elements, dx)
    }
}

/// The mean of ‖T Tᵀ - 1‖ (Frobenius) over clouds, and its derivative with respect to the elements:
/// 2 E T / ‖E‖ with the symmetric E = T Tᵀ - 1.
#[must_use]
pub fn orthogonality(transforms: &Transforms) -> (f64, Matrix) {
    let n = transforms.elements.nrows() as f32;
    let mut gradient = Matrix::zeros(transforms.elements.dim());
    let norms: Vec<f64> = gradient
        .axis_iter_mut(Axis(0))
        .into_par_iter()
        .enumerate()
        .map(|(cloud, mut gradient)| {
            let t = transforms.matrix(cloud);
            let mut error = t.dot(&t.t());
            error.diag_mut().iter_mut().for_each(|x| *x -= 1.0);
            let norm = error.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
            if norm > 0.0 {
                let factor = 2.0 / (norm as f32 * n);
                let product = error.dot(&t);
                gradient.iter_mut().zip(&product).for_each(|(out, x)| *out = factor * x);
            }
            norm
        })
        .collect();
    (norms.iter().sum::<f64>() / f64::from(n), gradient)
}
