//! Stacks of layers: the shared MLP before a pooling, the dense head after it.

use ndarray::ArrayView2;

use crate::layer::{Folded, Linear, Module, PointLayer, PooledLayer, Rows, VectorLayer};
use crate::matrix::Matrix;
use crate::parameter::Parameter;

/// Point-wise layers, the last of which is pooled.
#[derive(Clone, Debug)]
pub struct SharedMlp {
    hidden: Vec<PointLayer>,
    /// The last layer.
    pub pooled: PooledLayer,
}

impl SharedMlp {
    /// `widths` with the inputs first. Layers are named from number `first`.
    pub fn new(prefix: &str, widths: &[usize], first: usize, relu: bool, seed: u64) -> Self {
        let pairs: Vec<_> = widths.windows(2).map(|pair| (pair[0], pair[1])).collect();
        let names = |i: usize| {
            let number = first + i;
            (format!("{prefix}conv{number}"), format!("{prefix}bn{number}"))
        };
        let last = pairs.len() - 1;
        let hidden = pairs[..last].iter().enumerate().map(|(i, &size)| {
            let (linear, norm) = names(i);
            PointLayer::new(&linear, &norm, size, seed)
        });
        let (linear, norm) = names(last);
        let pooled = PooledLayer::new(&linear, &norm, pairs[last], relu, seed);
        Self { hidden: hidden.collect(), pooled }
    }

    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        for i in 0..self.hidden.len() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let x = before.last().map_or(x.view(), |layer| layer.base.output());
            layer[0].forward(x, rows, momentum);
        }
        let x = self.hidden.last().map_or(x, |layer| layer.base.output());
        self.pooled.forward(x, rows, momentum);
    }

    /// Returns the gradient of `x`, if `wants_input`.
    pub fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        dy: Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let input = self.hidden.last().map_or(x.view(), |layer| layer.base.output());
        let wanted = wants_input || !self.hidden.is_empty();
        let mut dy = self.pooled.backward(dy, input, rows, wanted)?;
        for i in (0..self.hidden.len()).rev() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let input = before.last().map_or(x.view(), |layer| layer.base.output());
            let dz = layer[0].backward(input, dy, rows);
            if i == 0 && !wants_input {
                return None;
            }
            dy = layer[0].input_gradient(&dz);
        }
        Some(dy)
    }

    /// The first layer whose last output is not finite.
    pub fn not_finite(&self) -> Option<&str> {
        let hidden = self.hidden.iter().find_map(|layer| layer.base.not_finite());
        hidden.or_else(|| self.pooled.base.not_finite())
    }
}

impl Module for SharedMlp {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.hidden.iter_mut().for_each(|layer| layer.base.parameters(visit));
        self.pooled.base.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.hidden.iter_mut().for_each(|layer| layer.base.statistics(visit));
        self.pooled.base.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.hidden.iter().for_each(|layer| layer.base.folded(visit));
        self.pooled.base.folded(visit);
    }
}

/// Dense layers after a pooling.
#[derive(Clone, Debug)]
pub struct DenseHead {
    /// All layers except the last.
    pub hidden: Vec<VectorLayer>,
    last: Linear,
}

impl DenseHead {
    /// `widths` with inputs first and outputs last. Batch norms are numbered
    /// after those of `n_points` point-wise layers.
    pub fn new(prefix: &str, widths: &[usize], n_points: usize, seed: u64) -> Self {
        let n = widths.len() - 1;
        let hidden = widths.windows(2).take(n - 1).zip(1..).map(|(pair, i)| {
            let (linear, norm) = (format!("{prefix}fc{i}"), format!("{prefix}bn{}", n_points + i));
            VectorLayer::new(&linear, &norm, (pair[0], pair[1]), seed)
        });
        let last = Linear::new(&format!("{prefix}fc{n}"), widths[n - 1], widths[n], seed);
        Self { hidden: hidden.collect(), last }
    }

    /// `kept` is the dropout mask of the last layer but one.
    pub fn forward(
        &mut self,
        x: ArrayView2<'_, f32>,
        mut kept: Option<Matrix>,
        momentum: f32,
    ) -> Matrix {
        let n = self.hidden.len();
        for i in 0..n {
            let (before, layer) = self.hidden.split_at_mut(i);
            let x = before.last().map_or(x.view(), |layer| layer.base.output());
            let kept = if i + 1 == n { kept.take() } else { None };
            layer[0].forward(x, kept, momentum);
        }
        self.last.forward(self.hidden.last().map_or(x, |layer| layer.base.output()))
    }

    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dz: ArrayView2<'_, f32>) -> Matrix {
        let input = self.hidden.last().map_or(x.view(), |layer| layer.base.output());
        let mut dy = self.last.backward(input, dz);
        for i in (0..self.hidden.len()).rev() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let input = before.last().map_or(x.view(), |layer| layer.base.output());
            dy = layer[0].backward(input, dy);
        }
        dy
    }

    /// The first layer whose last output is not finite.
    pub fn not_finite(&self) -> Option<&str> {
        self.hidden.iter().find_map(|layer| layer.base.not_finite())
    }
}

impl Module for DenseHead {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.hidden.iter_mut().for_each(|layer| layer.base.parameters(visit));
        self.last.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.hidden.iter_mut().for_each(|layer| layer.base.statistics(visit));
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.hidden.iter().for_each(|layer| layer.base.folded(visit));
        self.last.folded(visit);
    }
}
