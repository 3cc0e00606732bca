//! A T-Net: a small PointNet that predicts a transform of its own input.

use ndarray::ArrayView2;

use crate::layer::{LayerMut, Module, Transforms};
use crate::matrix::Matrix;
use crate::mlp::{DenseHead, SharedMlp};
use crate::rows::Rows;
use crate::shape::Shape;

#[derive(Clone, Debug)]
pub struct TNet {
    points: SharedMlp,
    head: DenseHead,
    /// The last predicted transforms.
    pub transforms: Transforms,
}

impl TNet {
    pub fn new(prefix: &str, k: usize, shape: &Shape, seed: u64) -> Self {
        let widths = [&[k], &shape.t_net[..]].concat();
        let n_points = shape.t_net.len();
        let head_widths = [&[widths[n_points]], &shape.t_net_head[..], &[k * k]].concat();
        Self {
            points: SharedMlp::new(prefix, &widths, 1, true, seed),
            head: DenseHead::new(prefix, &head_widths, n_points, seed),
            transforms: Transforms { k, ..Transforms::default() },
        }
    }

    pub fn predict(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        self.points.forward(x, rows, momentum);
        let elements = self.head.forward(self.points.pooled.base.output(), None, momentum);
        self.transforms = Transforms::around_identity(elements, self.transforms.k);
    }

    /// Propagates the gradient of the transforms' elements. If `wants_input`, returns the part of
    /// the gradient of `x` that flows through the prediction.
    pub fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        elements: &Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let pooled = self.points.pooled.base.output().to_owned();
        let dy = self.head.backward(pooled.view(), elements.view());
        self.points.backward(x, dy, rows, wants_input)
    }
}

impl Module for TNet {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        self.points.layers().into_iter().chain(self.head.layers()).collect()
    }
}
