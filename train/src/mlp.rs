//! Stacks of layers: the shared MLP before a pooling, and the dense head after it.

use ndarray::ArrayView2;

use crate::batch::Rows;
use crate::layer::{HiddenLayer, LayerMut, Linear, Module, PooledLayer};
use crate::matrix::Matrix;

/// Hidden layers in sequence.
#[derive(Clone, Debug)]
struct Stack(Vec<HiddenLayer>);

impl Stack {
    /// Layers of these `widths`, beginning with the inputs, whose linear parts are named `linear`
    /// and the number of the layer, and whose norms `norm` and the number.
    fn new([linear, norm]: [&str; 2], widths: &[usize], seed: u64) -> Self {
        let layer = |(pair, i): (&[usize], usize)| {
            let [linear, norm] = [linear, norm].map(|part| format!("{part}{i}"));
            HiddenLayer::new(&linear, &norm, (pair[0], pair[1]), seed)
        };
        Self(widths.windows(2).zip(1..).map(layer).collect())
    }

    /// The output of the last layer; without layers, `x`.
    fn output<'a>(&'a self, x: ArrayView2<'a, f32>) -> ArrayView2<'a, f32> {
        self.0.last().map_or(x, |layer| layer.base.output())
    }

    /// Applies all layers to `x` and returns the output of the last. `kept` is the dropout mask of
    /// the last layer.
    fn forward<'a>(
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
        self.output(x)
    }

    /// Propagates the gradient of the output. Returns the gradient of `x` if `wants_input`.
    fn backward(
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

    fn layers(&mut self) -> impl Iterator<Item = LayerMut<'_>> {
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
    /// Layers of these `widths`, beginning with the inputs.
    pub fn new(prefix: &str, widths: &[usize], relu: bool, seed: u64) -> Self {
        let n = widths.len() - 1;
        let [linear, norm] = ["conv", "bn"].map(|part| format!("{prefix}{part}"));
        let hidden = Stack::new([&linear, &norm], &widths[..n], seed);
        let [linear, norm] = [linear, norm].map(|part| format!("{part}{n}"));
        let size = (widths[n - 1], widths[n]);
        Self { hidden, pooled: PooledLayer::new(&linear, &norm, size, relu, seed) }
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
        let wants_hidden = wants_input || !self.hidden.0.is_empty();
        let dy = self.pooled.backward(dy, self.hidden.output(x), rows, wants_hidden)?;
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
    /// Layers of these `widths`, from the inputs to the outputs.
    pub fn new(widths: &[usize], seed: u64) -> Self {
        let n = widths.len() - 1;
        let last = Linear::new(&format!("fc{n}"), widths[n - 1], widths[n], seed);
        Self { hidden: Stack::new(["fc", "bn"], &widths[..n], seed), last }
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
        let dy = self.last.backward(self.hidden.output(x), dz);
        let dx = self.hidden.backward(x, dy, Rows::new(&ones, &[]), true);
        dx.expect("invariant: `wants_input` is true")
    }
}

impl Module for DenseHead {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let last = LayerMut { linear: &mut self.last, norm: None, output: None };
        self.hidden.layers().chain([last]).collect()
    }
}
