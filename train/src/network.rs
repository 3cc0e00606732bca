//! PointNet for classification, forward and backward.
//!
//! The names of parameters are those of yanx27's `pointnet_cls`, which infer-cpu reads, such as
//! `feat.stn.conv1.weight`, `feat.fstn.bn4.bias` and `fc3.weight`.

use ndarray::{ArrayView2, Axis, s};

use crate::batch::Batch;
use crate::layer::{EdgeLayer, HiddenLayer, LayerMut, Module, orthogonality};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::mlp::{DenseHead, SharedMlp};
use crate::shape::Shape;
use crate::t_net::TNet;

/// The settings of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// The share of a batch in the running statistics.
    pub momentum: f32,
    /// The weight of the feature transform's regulariser.
    pub orthogonality: f32,
}

/// A PointNet in training.
#[derive(Clone, Debug)]
pub struct PointNet {
    stn: Option<TNet>,
    edges: Vec<EdgeLayer>,
    stem: HiddenLayer,
    fstn: Option<TNet>,
    trunk: SharedMlp,
    head: DenseHead,
}

impl PointNet {
    /// A network with random weights for `n_classes` classes.
    ///
    /// # Panics
    /// If `shape` has fewer than two layers before a pooling.
    #[must_use]
    pub fn new(shape: &Shape, n_classes: usize, seed: u64) -> Self {
        let Shape { input_transform, feature_transform, trunk, .. } = shape;
        let numbered = shape.edges.iter().zip(1..);
        let edges: Vec<EdgeLayer> = numbered
            .map(|(edge, number)| EdgeLayer::new(number, edge.radius, edge.channels, seed))
            .collect();
        let inputs = 3 + edges.iter().map(EdgeLayer::channels).sum::<usize>();
        let stem = HiddenLayer::new("feat.conv1", "feat.bn1", (inputs, trunk[0]), seed);
        let stn = input_transform.then(|| TNet::new("feat.stn.", 3, shape, seed));
        let fstn = feature_transform.then(|| TNet::new("feat.fstn.", trunk[0], shape, seed));
        let pooled = trunk[trunk.len() - 1];
        let head =
            DenseHead::new("", &[&[pooled], &shape.head[..], &[n_classes]].concat(), 0, seed);
        Self { stn, edges, stem, fstn, trunk: SharedMlp::new("feat.", trunk, 2, false, seed), head }
    }

    /// Runs the forward and backward pass of a batch, which sets the gradients of the parameters.
    /// `kept` is the dropout mask, `[clouds, last hidden width]`.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        let momentum = rates.momentum;
        let (x, rows) = (batch.points(), batch.rows());
        let transformed = self.stn.as_mut().map(|stn| {
            stn.predict(x, rows, momentum);
            stn.transforms.forward(x, rows)
        });
        let transformed = transformed.as_ref().map_or(x.view(), |transformed| transformed.view());
        let with_edges = self.edge_features(batch, transformed, momentum);
        let entry = with_edges.as_ref().map_or(transformed, |with_edges| with_edges.view());
        self.stem.forward(entry, rows, None, momentum);
        let stem = self.stem.base.output().to_owned();
        let transformed_stem = self.fstn.as_mut().map(|fstn| {
            fstn.predict(stem.view(), rows, momentum);
            fstn.transforms.forward(stem.view(), rows)
        });
        let features =
            transformed_stem.as_ref().map_or(stem.view(), |transformed| transformed.view());
        self.trunk.forward(features.view(), rows, momentum);
        let pooled = self.trunk.pooled.base.output().to_owned();
        let logits = self.head.forward(pooled.view(), kept, momentum);

        let (mut loss, dlogits) = loss::cross_entropy(logits, &batch.targets);
        let dpooled = self.head.backward(pooled.view(), dlogits.view());
        let dfeatures = self.trunk.backward(features, dpooled, rows, true);
        let mut dstem = dfeatures.expect("invariant: `wants_input` is true");
        if let Some(fstn) = &mut self.fstn {
            let (norm, own) = orthogonality(&fstn.transforms);
            loss.orthogonality = norm;
            loss.total += f64::from(rates.orthogonality) * norm;
            let (mut elements, through) = fstn.transforms.backward(stem.view(), dstem.view(), rows);
            elements += &(own * rates.orthogonality);
            let predicted = fstn.backward(stem.view(), &elements, rows, true);
            dstem = through + predicted.expect("invariant: `wants_input` is true");
        }
        let dz = self.stem.backward(entry, dstem, rows);
        if self.stn.is_none() && self.edges.is_empty() {
            return loss;
        }
        let dentry = self.stem.base.linear.input_gradient(dz.view());
        let mut first = 3;
        for edge in &mut self.edges {
            let own = first..first + edge.channels();
            first = own.end;
            edge.backward(dentry.slice(s![.., own]).to_owned());
        }
        if let Some(stn) = &mut self.stn {
            let dtransformed = dentry.slice(s![.., ..3]);
            let (elements, _) = stn.transforms.backward(x, dtransformed, rows);
            stn.backward(x, &elements, rows, false);
        }
        loss
    }

    /// The coordinates `[rows, 3]` followed by the EdgeConv features of each point. `None` if the
    /// network has no EdgeConv layer.
    fn edge_features(
        &mut self,
        batch: &Batch,
        coordinates: ArrayView2<'_, f32>,
        momentum: f32,
    ) -> Option<Matrix> {
        if self.edges.is_empty() {
            return None;
        }
        self.edges.iter_mut().for_each(|edge| edge.forward(batch, momentum));
        let parts = self.edges.iter().map(EdgeLayer::output);
        let parts: Vec<_> = std::iter::once(coordinates).chain(parts).collect();
        Some(ndarray::concatenate(Axis(1), &parts).expect("invariant: a row for each point"))
    }

    /// The width of the dropout mask. `None` if there is no hidden layer after the trunk's pooling.
    #[must_use]
    pub fn dropout_width(&self) -> Option<usize> {
        self.head.hidden_width()
    }
}

impl Module for PointNet {
    fn layers(&mut self) -> Vec<LayerMut<'_>> {
        let Self { stn, edges, stem, fstn, trunk, head } = self;
        let stn = stn.iter_mut().flat_map(Module::layers);
        let edges = edges.iter_mut().map(|edge| edge.pooled.base.layer());
        let fstn = fstn.iter_mut().flat_map(Module::layers);
        let points = stn.chain(edges).chain([stem.base.layer()]).chain(fstn);
        points.chain(trunk.layers()).chain(head.layers()).collect()
    }
}
