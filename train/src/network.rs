//! PointNet for classification, forward and backward.
//!
//! Names of parameters are those of yanx27's `pointnet_cls`, which infer-cpu
//! reads: `feat.stn.conv1.weight`, `feat.fstn.bn4.bias`, `fc3.weight`, ….

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::layer::{
    Folded, Learns, Linear, PointLayer, PooledLayer, Rows, Transforms, VectorLayer, orthogonality,
};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::parameter::Parameter;

/// Which layers a network has, and how wide they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shape {
    /// The T-Net of the coordinates.
    pub input_transform: bool,
    /// The T-Net of the first layer's features.
    pub feature_transform: bool,
    /// Outputs of the trunk's point-wise layers, the last pooled.
    pub trunk: Vec<usize>,
    /// Outputs of a T-Net's point-wise layers, the last pooled.
    pub t_net: Vec<usize>,
    /// Outputs of a T-Net's layers after the pooling.
    pub t_net_head: Vec<usize>,
    /// Outputs of the layers after the trunk's pooling, but for the last.
    pub head: Vec<usize>,
}

impl Default for Shape {
    /// The baseline's (yanx27/Pointnet_Pointnet2_pytorch, `pointnet_cls`).
    fn default() -> Self {
        Self {
            input_transform: true,
            feature_transform: true,
            trunk: vec![64, 128, 1024],
            t_net: vec![64, 128, 1024],
            t_net_head: vec![512, 256],
            head: vec![512, 256],
        }
    }
}

impl Shape {
    /// All widths.
    pub fn widths(&self) -> impl Iterator<Item = usize> {
        let Self { trunk, t_net, t_net_head, head, .. } = self;
        [trunk, t_net, t_net_head, head].into_iter().flatten().copied()
    }
}

/// Shares that a pass is run with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// By how much running statistics follow a batch's.
    pub momentum: f32,
    /// Weight of the feature transform's regulariser.
    pub orthogonality: f32,
}

/// Point-wise layers and a pooling.
#[derive(Clone, Debug)]
struct Points {
    hidden: Vec<PointLayer>,
    pooled: PooledLayer,
}

impl Points {
    /// `widths` with the inputs first. Layers are named from number `first`.
    fn new(prefix: &str, widths: &[usize], first: usize, relu: bool, seed: u64) -> Self {
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

    fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) {
        for i in 0..self.hidden.len() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let x = before.last().map_or(x.view(), PointLayer::output);
            layer[0].forward(x, rows, momentum);
        }
        let x = self.hidden.last().map_or(x, PointLayer::output);
        self.pooled.forward(x, rows, momentum);
    }

    /// Returns the gradient of `x` where it is wanted.
    fn backward(
        &mut self,
        x: ArrayView2<'_, f32>,
        dy: Matrix,
        rows: Rows<'_>,
        wants_input: bool,
    ) -> Option<Matrix> {
        let input = self.hidden.last().map_or(x.view(), PointLayer::output);
        let mut dy = self.pooled.backward(dy, input, rows);
        for i in (0..self.hidden.len()).rev() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let input = before.last().map_or(x.view(), PointLayer::output);
            let dz = layer[0].backward(input, dy, rows);
            if i == 0 && !wants_input {
                return None;
            }
            dy = layer[0].input_gradient(&dz);
        }
        Some(dy)
    }
}

impl Points {
    fn not_finite(&self) -> Option<&str> {
        let hidden = self.hidden.iter().find_map(PointLayer::not_finite);
        hidden.or_else(|| self.pooled.not_finite())
    }
}

impl Learns for Points {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.hidden.iter_mut().for_each(|layer| layer.parameters(visit));
        self.pooled.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.hidden.iter_mut().for_each(|layer| layer.statistics(visit));
        self.pooled.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.hidden.iter().for_each(|layer| layer.folded(visit));
        self.pooled.folded(visit);
    }
}

/// Layers after a pooling.
#[derive(Clone, Debug)]
struct Vectors {
    hidden: Vec<VectorLayer>,
    last: Linear,
}

impl Vectors {
    /// `widths` with inputs first and outputs last. Batch norms are numbered
    /// after those of `n_points` point-wise layers.
    fn new(prefix: &str, widths: &[usize], n_points: usize, seed: u64) -> Self {
        let n = widths.len() - 1;
        let hidden = widths.windows(2).take(n - 1).zip(1..).map(|(pair, i)| {
            let (linear, norm) = (format!("{prefix}fc{i}"), format!("{prefix}bn{}", n_points + i));
            VectorLayer::new(&linear, &norm, (pair[0], pair[1]), seed)
        });
        let last = Linear::new(&format!("{prefix}fc{n}"), widths[n - 1], widths[n], seed);
        Self { hidden: hidden.collect(), last }
    }

    /// `kept` is dropout's mask of the last layer but one.
    fn forward(
        &mut self,
        x: ArrayView2<'_, f32>,
        mut kept: Option<Matrix>,
        momentum: f32,
    ) -> Matrix {
        let n = self.hidden.len();
        for i in 0..n {
            let (before, layer) = self.hidden.split_at_mut(i);
            let x = before.last().map_or(x.view(), VectorLayer::output);
            let kept = if i + 1 == n { kept.take() } else { None };
            layer[0].forward(x, kept, momentum);
        }
        self.last.forward(self.hidden.last().map_or(x, VectorLayer::output))
    }

    fn backward(&mut self, x: ArrayView2<'_, f32>, dz: ArrayView2<'_, f32>) -> Matrix {
        let input = self.hidden.last().map_or(x.view(), VectorLayer::output);
        let mut dy = self.last.backward(input, dz);
        for i in (0..self.hidden.len()).rev() {
            let (before, layer) = self.hidden.split_at_mut(i);
            let input = before.last().map_or(x.view(), VectorLayer::output);
            dy = layer[0].backward(input, dy);
        }
        dy
    }
}

impl Vectors {
    fn not_finite(&self) -> Option<&str> {
        self.hidden.iter().find_map(VectorLayer::not_finite)
    }
}

impl Learns for Vectors {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        self.hidden.iter_mut().for_each(|layer| layer.parameters(visit));
        self.last.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        self.hidden.iter_mut().for_each(|layer| layer.statistics(visit));
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        self.hidden.iter().for_each(|layer| layer.folded(visit));
        self.last.folded(visit);
    }
}

/// What predicts a transform.
#[derive(Clone, Debug)]
struct TNet {
    points: Points,
    vectors: Vectors,
    transforms: Transforms,
}

impl TNet {
    fn new(prefix: &str, k: usize, shape: &Shape, seed: u64) -> Self {
        let widths = joined(&[k], &shape.t_net, &[]);
        let n_points = shape.t_net.len();
        let head = joined(&[widths[n_points]], &shape.t_net_head, &[k * k]);
        Self {
            points: Points::new(prefix, &widths, 1, true, seed),
            vectors: Vectors::new(prefix, &head, n_points, seed),
            transforms: Transforms { k, ..Transforms::default() },
        }
    }

    /// Returns the rows behind the transforms.
    fn forward(&mut self, x: ArrayView2<'_, f32>, rows: Rows<'_>, momentum: f32) -> Matrix {
        self.points.forward(x.view(), rows, momentum);
        let elements = self.vectors.forward(self.points.pooled.output(), None, momentum);
        self.transforms = Transforms::around_identity(elements, self.transforms.k);
        self.transforms.forward(x, rows)
    }

    /// From the gradient of the rows behind the transforms, and one of the
    /// transforms' own; returns that of `x` where it is wanted.
    fn backward(
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
        let pooled = self.points.pooled.output().to_owned();
        let dy = self.vectors.backward(pooled.view(), elements.view());
        let around = self.points.backward(x, dy, rows, wants_input)?;
        Some(through + around)
    }
}

impl TNet {
    fn not_finite(&self) -> Option<&str> {
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

/// A PointNet in training.
#[derive(Clone, Debug)]
pub struct PointNet {
    stn: Option<TNet>,
    stem: PointLayer,
    fstn: Option<TNet>,
    trunk: Points,
    head: Vectors,
}

impl PointNet {
    /// A network of random weights for `n_classes`.
    ///
    /// # Panics
    /// If `shape` has fewer than two layers before a pooling.
    #[must_use]
    pub fn new(shape: &Shape, n_classes: usize, seed: u64) -> Self {
        let Shape { input_transform, feature_transform, trunk, .. } = shape;
        let stem = PointLayer::new("feat.conv1", "feat.bn1", (3, trunk[0]), seed);
        let stn = input_transform.then(|| TNet::new("feat.stn.", 3, shape, seed));
        let fstn = feature_transform.then(|| TNet::new("feat.fstn.", trunk[0], shape, seed));
        let pooled = trunk[trunk.len() - 1];
        let head = Vectors::new("", &joined(&[pooled], &shape.head, &[n_classes]), 0, seed);
        Self { stn, stem, fstn, trunk: Points::new("feat.", trunk, 2, false, seed), head }
    }

    /// Takes a batch forward and backward: gradients are left in the
    /// parameters. `kept` is dropout's mask, `[clouds, last hidden width]`.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        let (x, rows, momentum) = (batch.points(), batch.rows(), rates.momentum);
        let turned = self.stn.as_mut().map(|stn| stn.forward(x.view(), rows, momentum));
        let entry = turned.as_ref().map_or(x.view(), |turned| turned.view());
        self.stem.forward(entry.view(), rows, momentum);
        let stem = self.stem.output().to_owned();
        let turned_stem = self.fstn.as_mut().map(|fstn| fstn.forward(stem.view(), rows, momentum));
        let features = turned_stem.as_ref().map_or(stem.view(), |turned| turned.view());
        self.trunk.forward(features.view(), rows, momentum);
        let pooled = self.trunk.pooled.output().to_owned();
        let logits = self.head.forward(pooled.view(), kept, momentum);

        let (mut loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dpooled = self.head.backward(pooled.view(), dlogits.view());
        let dfeatures = self.trunk.backward(features, dpooled, rows, true);
        let mut dstem = dfeatures.expect("invariant: it was asked for");
        if let Some(fstn) = &mut self.fstn {
            let (norm, own) = orthogonality(&fstn.transforms);
            loss.orthogonality = norm;
            loss.total += f64::from(rates.orthogonality) * norm;
            let own = own * rates.orthogonality;
            let dx = fstn.backward(stem.view(), &dstem, Some(own), rows, true);
            dstem = dx.expect("invariant: it was asked for");
        }
        let dz = self.stem.backward(entry, dstem, rows);
        if let Some(stn) = &mut self.stn {
            let dentry = self.stem.input_gradient(&dz);
            stn.backward(x, &dentry, None, rows, false);
        }
        loss
    }

    /// The first layer whose last output was not finite; the last of all if no
    /// other.
    #[must_use]
    pub fn not_finite(&self) -> &str {
        let stn = self.stn.as_ref().and_then(TNet::not_finite);
        stn.or_else(|| self.stem.not_finite())
            .or_else(|| self.fstn.as_ref().and_then(TNet::not_finite))
            .or_else(|| self.trunk.not_finite())
            .or_else(|| self.head.not_finite())
            .unwrap_or("the last")
    }

    /// How wide dropout's mask is; none without a hidden layer after the
    /// trunk's pooling.
    #[must_use]
    pub fn dropout_width(&self) -> Option<usize> {
        self.head.hidden.last().map(|layer| layer.output().ncols())
    }
}

impl Learns for PointNet {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        if let Some(stn) = &mut self.stn {
            stn.parameters(visit);
        }
        self.stem.parameters(visit);
        if let Some(fstn) = &mut self.fstn {
            fstn.parameters(visit);
        }
        self.trunk.parameters(visit);
        self.head.parameters(visit);
    }

    fn statistics(&mut self, visit: &mut dyn FnMut(&str, &mut Vec<f32>)) {
        if let Some(stn) = &mut self.stn {
            stn.statistics(visit);
        }
        self.stem.statistics(visit);
        if let Some(fstn) = &mut self.fstn {
            fstn.statistics(visit);
        }
        self.trunk.statistics(visit);
        self.head.statistics(visit);
    }

    fn folded(&self, visit: &mut dyn FnMut(Folded)) {
        if let Some(stn) = &self.stn {
            stn.folded(visit);
        }
        self.stem.folded(visit);
        if let Some(fstn) = &self.fstn {
            fstn.folded(visit);
        }
        self.trunk.folded(visit);
        self.head.folded(visit);
    }
}

fn joined(a: &[usize], b: &[usize], c: &[usize]) -> Vec<usize> {
    [a, b, c].concat()
}
