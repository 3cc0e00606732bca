//! Arrays that are learnt.

use ndarray::ArrayView2;

/// An array that is learnt, with its gradient and the optimiser's moments.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name in model files and checkpoints.
    pub name: String,
    /// The shape in model files and checkpoints.
    pub shape: Vec<usize>,
    /// The elements in C order.
    pub value: Vec<f32>,
    /// The derivative of the loss with respect to each element.
    pub gradient: Vec<f32>,
    /// Adam's running mean of the gradients.
    pub mean: Vec<f32>,
    /// Adam's running mean of the squared gradients.
    pub square: Vec<f32>,
}

impl Parameter {
    /// A parameter with this `value`.
    pub fn new(name: String, shape: Vec<usize>, value: Vec<f32>) -> Self {
        let zeros = vec![0.0; value.len()];
        let (gradient, mean, square) = (zeros.clone(), zeros.clone(), zeros);
        Self { name, shape, value, gradient, mean, square }
    }

    /// The weights as a matrix, `[outputs, inputs]`.
    pub fn matrix(&self) -> ArrayView2<'_, f32> {
        let (outputs, inputs) = (self.shape[0], self.shape[1]);
        ArrayView2::from_shape((outputs, inputs), &self.value)
            .expect("invariant: shape and elements agree")
    }
}
