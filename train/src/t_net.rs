//! A T-Net: a small PointNet that predicts a transform of its own input.

use ndarray::ArrayView2;

use crate::layer::{Folded, Learns, Rows, Transforms};
use crate::matrix::Matrix;
use crate::network::Shape;
use crate::parameter::Parameter;
use crate::stack::{Points, Vectors};

/// What predicts a transform.
#[derive(Clone, Debug)]
pub struct TNet {
    /// What is pooled.
    pub points: Points,
    vectors: Vectors,
    /// What it predicted.
    pub transforms: Transforms,
}

impl TNet {
    pub fn new(prefix: &str, k: usize, shape: &Shape, seed: u64) -> Self {
        let widths = [&[k], &shape.t_net[..]].concat();
        let n_points = shape.t_net.len();
        let head = [&[widths[n_points]], &shape.t_net_head[..], &[k * k]].concat();
        Self {
            points: Points::new(prefix, &widths, 1, true, seed),
            vectors: Vectors::new(prefix, &head, n_points, seed),
            transforms: Transforms { k, ..Transforms::default() },
        }
    }

    /// Returns the rows behind the transforms.
    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) -> Matrix {
        self.predict(x.view(), rows, momentum);
        self.transforms.forward(x, rows)
    }

    /// Predicts the transforms, and transforms nothing.
    pub fn predict(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        self.points.forward(x.view(), rows, momentum);
        let elements = self.vectors.forward(self.points.pooled.base.output(), None, momentum);
        self.transforms = Transforms::around_identity(elements, self.transforms.k);
    }

    /// From the gradient of the rows behind the transforms, and one of the
    /// transforms' own; returns that of `x` where it is wanted.
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
        let around = self.backward_prediction(x, &elements, rows, wants_input)?;
        Some(through + around)
    }

    /// From the gradient of the transforms' elements; returns that of `x`, as
    /// far as it comes through the prediction, where it is wanted.
    pub fn backward_prediction(
        &mut self,
        x: ArrayView2<'_, f32>,
        elements: &Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let pooled = self.points.pooled.base.output().to_owned();
        let dy = self.vectors.backward(pooled.view(), elements.view());
        self.points.backward(x, dy, rows, wants_input)
    }

    /// The first layer whose last output is not finite.
    pub fn not_finite(&self) -> Option<&str> {
        self.points.not_finite().or_else(|| self.vectors.not_finite())
    }
}

impl Learns for TNet {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.points.parameters(visit);
        self.vectors.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.points.statistics(visit);
        self.vectors.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.points.folded(visit);
        self.vectors.folded(visit);
    }
}
