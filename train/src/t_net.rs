//! A T-Net: a small PointNet that predicts a transform of its own input.

use ndarray::ArrayView2;

use crate::layer::{LayerMut, Module, Rows, Transforms};
use crate::matrix::Matrix;
use crate::mlp::{DenseHead, SharedMlp};
use crate::shape::Shape;

/// A T-Net in training.
#[derive(Clone, Debug)]
pub struct TNet {
    /// Its point-wise layers and the pooling.
    pub points: SharedMlp,
    head: DenseHead,
    /// The transforms that it predicted last.
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

    /// Predicts the transforms and returns the transformed rows.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) -> Matrix {
        self.predict(x.view(), rows, momentum);
        self.transforms.forward(x, rows)
    }

    /// Predicts the transforms without applying them.
    pub fn predict(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        self.points.forward(x.view(), rows, momentum);
        let elements = self.head.forward(self.points.pooled.base.output(), None, momentum);
        self.transforms = Transforms::around_identity(elements, self.transforms.k);
    }

    /// Takes the gradients of the transformed rows and, as `own`, of the
    /// transforms; returns that of `x`, if `wants_input`.
    pub fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        dy: &Matrix,
        own: Option<Matrix>,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let (mut elements, through) = self.transforms.backward(x.view(), dy.view(), rows);
        if let Some(own) = own {
            elements += &own;
        }
        let predicted = self.backward_prediction(x, &elements, rows, wants_input)?;
        Some(through + predicted)
    }

    /// Takes the gradient of the transforms' elements; returns the part of the
    /// gradient of `x` that flows through the prediction, if `wants_input`.
    pub fn backward_prediction(
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
