//! Stacks of layers: the shared MLP before a pooling, and the dense head after it.

use ndarray::ArrayView2;

use crate::layer::{HiddenLayer, LayerMut, Linear, Module, PooledLayer};
use crate::matrix::Matrix;
use crate::rows::Rows;

/// Hidden layers in sequence.
#[derive(Clone, Debug)]
pub struct Stack(Vec<HiddenLayer>);

impl Stack {
    /// Layers of these `widths`, beginning with the inputs. Their numbers begin with `first`.
    pub fn new(prefix: &str, widths: &[usize], first: usize, seed: u64) -> Self {
        let layer = |(pair, i): (&[usize], usize)| {
            let [linear, norm] = ["conv", "bn"].map(|part| format!("{prefix}{part}{i}"));
            HiddenLayer::new(&linear, &norm, (pair[0], pair[1]), seed)
        };
        Self(widths.windows(2).zip(first..).map(layer).collect())
    }

    /// The output of the last layer in the last forward pass.
    ///
    /// # Panics
    /// If there is no layer.
    pub fn output(&self) -> ArrayView2<'_, f32> {
        self.0[self.0.len() - 1].base.output()
    }

    /// The input of layer `i`; that of the first layer is `x`.
    fn input<'a>(&'a self, i: usize, x: ArrayView2<'a, f32>) -> ArrayView2<'a, f32> {
        if i == 0 { x } else { self.0[i - 1].base.output() }
    }

    /// Applies all layers to `x` and returns the output of the last. `kept` is the dropout mask of
    /// the last layer.
    pub fn forward<'a>(
        &'a mut self,
        x: ArrayView2<'a, f32>,
        rows: Rows<'_>,
        mut kept: Option<Matrix>,
        momentum: f32,
    ) -> ArrayView2<'a, f32> {
        let n = self.0.len();
        for i in 0..n {
            let (before, layer) = self.0.split_at_mut(i);
            let x = before.last().map_or(x, |layer| layer.base.output());
            layer[0].forward(x, rows, kept.take_if(|_| i + 1 == n), momentum);
        }
        self.input(n, x)
    }

    /// Propagates the gradient of the output. Returns the gradient of `x` if `wants_input`.
    pub fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        mut dy: Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        for i in (0..self.0.len()).rev() {
            let (before, layer) = self.0.split_at_mut(i);
            let input = before.last().map_or(x, |layer| layer.base.output());
            let dz = layer[0].backward(input, dy, rows);
            if i == 0 && !wants_input {
                return None;
            }
            dy = layer[0].base.linear.input_gradient(dz.view());
        }
        Some(dy)
    }

    pub fn layers(&mut self) -> impl Iterator<Item = LayerMut<'_>> {
        self.0.iter_mut().map(|layer| layer.base.layer())
    }
}

/// Point-wise layers. The last layer is pooled.
#[derive(Clone, Debug)]
pub struct SharedMlp {
    hidden: Stack,
    pub pooled: PooledLayer,
}

impl SharedMlp {
    /// Layers of these `widths`, beginning with the inputs. Their numbers begin with `first`.
    pub fn new(prefix: &str, widths: &[usize], first: usize, relu: bool, seed: u64) -> Self {
        let n = widths.len() - 1;
        let [linear, norm] = ["conv", "bn"].map(|part| format!("{prefix}{part}{}", first + n - 1));
        Self {
            hidden: Stack::new(prefix, &widths[..n], first, seed),
            pooled: PooledLayer::new(&linear, &norm, (widths[n - 1], widths[n]), relu, seed),
        }
    }

    pub fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        let x = self.hidden.forward(x, rows, None, momentum);
        self.pooled.forward(x, rows, momentum);
    }

    pub fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        dy: Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let n = self.hidden.0.len();
        let input = self.hidden.input(n, x);
        let dy = self.pooled.backward(dy, input, rows, wants_input || n > 0)?;
        self.hidden.backward(x, dy, rows, wants_input)
    }
}

impl Module for SharedMlp {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        self.hidden.layers().chain([self.pooled.base.layer()]).collect()
    }
}

#[derive(Clone, Debug)]
pub struct DenseHead {
    hidden: Stack,
    last: Linear,
}

impl DenseHead {
    /// Layers of these `widths`, from the inputs to the outputs. The numbers of the batch norms
    /// follow those of `n_points` point-wise layers.
    pub fn new(prefix: &str, widths: &[usize], n_points: usize, seed: u64) -> Self {
        let n = widths.len() - 1;
        let hidden = widths.windows(2).take(n - 1).zip(1..).map(|(pair, i)| {
            let (linear, norm) = (format!("{prefix}fc{i}"), format!("{prefix}bn{}", n_points + i));
            HiddenLayer::new(&linear, &norm, (pair[0], pair[1]), seed)
        });
        let last = Linear::new(&format!("{prefix}fc{n}"), widths[n - 1], widths[n], seed);
        Self { hidden: Stack(hidden.collect()), last }
    }

    /// Applies all layers to `x`. `kept` is the dropout mask of the last hidden layer.
    pub fn forward(
        &mut self,
        x: ArrayView2<'_, f32>,
        kept: Option<Matrix>,
        momentum: f32,
    ) -> Matrix {
        let ones = vec![1.0; x.nrows()];
        self.last.forward(self.hidden.forward(x, Rows::new(&ones, &[]), kept, momentum))
    }

    pub fn backward(&mut self, x: ArrayView2<'_, f32>, dz: ArrayView2<'_, f32>) -> Matrix {
        let ones = vec![1.0; x.nrows()];
        let dy = self.last.backward(self.hidden.input(self.hidden.0.len(), x), dz);
        let dx = self.hidden.backward(x, dy, Rows::new(&ones, &[]), true);
        dx.expect("invariant: `wants_input` is true")
    }

    pub fn hidden_width(&self) -> Option<usize> {
        self.hidden.0.last().map(|layer| layer.base.output.ncols())
    }
}

impl Module for DenseHead {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        self.hidden.layers().chain([self.last.layer()]).collect()
    }
}
