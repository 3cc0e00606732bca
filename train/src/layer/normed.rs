//! A linear layer and its batch norm, the base of every layer that is followed by a
//! ReLU or a pooling.

use ndarray::ArrayView2;

use super::{Folded, Linear, Module, Norm};
use crate::matrix::Matrix;
use crate::parameter::Parameter;

/// A linear layer, its batch norm, and the last output.
#[derive(Clone, Debug)]
pub struct Normed {
    /// `W x + b`.
    pub linear: Linear,
    /// The batch norm of its output.
    pub norm: Norm,
    /// The last output.
    pub output: Matrix,
}

impl Normed {
    /// Parts named `linear` and `norm`, of random weights.
    #[must_use]
    pub fn new(linear: &str, norm: &str, (inputs, outputs): (usize, usize), seed: u64) -> Self {
        Self {
            linear: Linear::new(linear, inputs, outputs, seed),
            norm: Norm::new(norm, outputs),
            output: Matrix::default((0, outputs)),
        }
    }

    /// The output of the last forward pass.
    #[must_use]
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.output.view()
    }

    /// The layer's name, if its last output is not finite.
    #[must_use]
    pub fn not_finite(&self) -> Option<&str> {
        (!self.output.iter().all(|x| x.is_finite())).then(|| self.linear.name())
    }
}

impl Module for Normed {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.linear.parameters(visit);
        visit(&mut self.norm.scale);
        visit(&mut self.norm.shift);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        let Norm { name, mean, variance, .. } = &mut self.norm;
        visit(&format!("{name}.running_mean"), mean);
        visit(&format!("{name}.running_var"), variance);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        visit(self.norm.folded_into(&self.linear));
    }
}
