//! PointNet for classification, forward and backward.
//!
//! Names of parameters are those of yanx27's `pointnet_cls`, which infer-cpu
//! reads: `feat.stn.conv1.weight`, `feat.fstn.bn4.bias`, `fc3.weight`, ….

use ndarray::{ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::chooser::{Chooser, Chosen};
use crate::layer::{EdgeLayer, Folded, Learns, PointLayer, orthogonality};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::parameter::Parameter;
use crate::stack::{Points, Vectors};
use crate::t_net::TNet;

/// A layer that looks around each point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// How far, in the unit of normalised clouds.
    pub radius: f32,
    /// Features that it gives a point.
    pub channels: usize,
}

/// Which layers a network has, and how wide they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shape {
    /// The T-Net of the coordinates.
    pub input_transform: bool,
    /// The T-Net of the first layer's features.
    pub feature_transform: bool,
    /// What a point's surroundings add to its coordinates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<Edge>,
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
            edges: Vec::new(),
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
        let Self { edges, trunk, t_net, t_net_head, head, .. } = self;
        let edges = edges.iter().map(|edge| edge.channels);
        [trunk, t_net, t_net_head, head].into_iter().flatten().copied().chain(edges)
    }
}

/// Shares that a pass is run with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// By how much running statistics follow a batch's.
    pub momentum: f32,
    /// Weight of the feature transform's regulariser.
    pub orthogonality: f32,
    /// The step, by which a relaxed choice of points draws.
    pub step: u64,
}

/// A PointNet in training.
#[derive(Clone, Debug)]
pub struct PointNet {
    stn: Option<TNet>,
    /// What the coordinates' T-Net chooses of the points, where it does.
    chooser: Option<Chooser>,
    edges: Vec<EdgeLayer>,
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
        let numbered = shape.edges.iter().zip(1..);
        let edges: Vec<EdgeLayer> = numbered
            .map(|(edge, number)| EdgeLayer::new(number, edge.radius, edge.channels, seed))
            .collect();
        let inputs = 3 + edges.iter().map(EdgeLayer::channels).sum::<usize>();
        let stem = PointLayer::new("feat.conv1", "feat.bn1", (inputs, trunk[0]), seed);
        let stn = input_transform.then(|| TNet::new("feat.stn.", 3, shape, seed));
        let fstn = feature_transform.then(|| TNet::new("feat.fstn.", trunk[0], shape, seed));
        let pooled = trunk[trunk.len() - 1];
        let head = Vectors::new("", &[&[pooled], &shape.head[..], &[n_classes]].concat(), 0, seed);
        Self {
            stn,
            chooser: None,
            edges,
            stem,
            fstn,
            trunk: Points::new("feat.", trunk, 2, false, seed),
            head,
        }
    }

    /// Lets the coordinates' T-Net choose the points that the rest sees.
    pub fn choose_by_t_net(&mut self, chooser: Chooser) {
        self.chooser = Some(chooser);
    }

    /// Takes a batch forward and backward: gradients are left in the
    /// parameters. `kept` is dropout's mask, `[clouds, last hidden width]`.
    pub fn learn(&mut self, batch: &Batch, kept: Option<Matrix>, rates: Rates) -> Loss {
        self.learn_points(batch, kept, rates, false).0
    }

    /// The same; returns the gradient of the points' coordinates, too, where it
    /// is wanted: that which comes through the trunk and the T-Nets, not
    /// through what surrounds a point.
    pub fn learn_points(
        &mut self,
        batch: &Batch,
        kept: Option<Matrix>,
        rates: Rates,
        wants_points: bool,
    ) -> (Loss, Option<Matrix>) {
        let (whole, momentum) = (batch, rates.momentum);
        let chosen = self.choose(whole, rates);
        let batch = chosen.as_ref().map_or(whole, |chosen| &chosen.batch);
        let (x, rows) = (batch.points(), batch.rows());
        let turned = match (&mut self.stn, &chosen) {
            (Some(stn), Some(_)) => Some(stn.transforms.forward(x.view(), rows)),
            (Some(stn), None) => Some(stn.forward(x.view(), rows, momentum)),
            (None, _) => None,
        };
        let turned = turned.as_ref().map_or(x.view(), |turned| turned.view());
        let edged = self.look_around(batch, turned, momentum);
        let entry = edged.as_ref().map_or(turned, |edged| edged.view());
        self.stem.forward(entry, rows, momentum);
        let stem = self.stem.base.output().to_owned();
        let turned_stem = self.fstn.as_mut().map(|fstn| fstn.forward(stem.view(), rows, momentum));
        let features = turned_stem.as_ref().map_or(stem.view(), |turned| turned.view());
        self.trunk.forward(features.view(), rows, momentum);
        let pooled = self.trunk.pooled.base.output().to_owned();
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
        if self.stn.is_none() && self.edges.is_empty() && !wants_points {
            return (loss, None);
        }
        let dentry = self.stem.input_gradient(&dz);
        let mut first = 3;
        for edge in &mut self.edges {
            let own = first..first + edge.channels();
            first = own.end;
            edge.backward(dentry.slice(s![.., own]).to_owned());
        }
        let dturned = dentry.slice(s![.., ..3]).to_owned();
        let dpoints = match &mut self.stn {
            Some(stn) if chosen.is_some() => {
                let (elements, _) = stn.transforms.backward(x, dturned.view(), rows);
                stn.backward_prediction(whole.points(), &elements, whole.rows(), false)
            }
            Some(stn) => stn.backward(x, &dturned, None, rows, wants_points),
            None => Some(dturned),
        };
        (loss, dpoints.filter(|_| wants_points))
    }

    /// What the coordinates' T-Net chooses of `whole`, where it does; then it
    /// has predicted its transforms, too.
    fn choose(&mut self, whole: &Batch, rates: Rates) -> Option<Chosen> {
        let (stn, chooser) = (self.stn.as_mut()?, self.chooser?);
        stn.predict(whole.points(), whole.rows(), rates.momentum);
        Some(chooser.choose(&stn.points.pooled, whole, rates.step))
    }

    /// Coordinates `[rows, 3]` with what surrounds each point; none where the
    /// network does not look.
    fn look_around(
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

    /// The first layer whose last output was not finite; the last of all if no
    /// other.
    #[must_use]
    pub fn not_finite(&self) -> &str {
        let stn = self.stn.as_ref().and_then(TNet::not_finite);
        let edges = || self.edges.iter().find_map(|edge| edge.pooled.base.not_finite());
        stn.or_else(edges)
            .or_else(|| self.stem.base.not_finite())
            .or_else(|| self.fstn.as_ref().and_then(TNet::not_finite))
            .or_else(|| self.trunk.not_finite())
            .or_else(|| self.head.not_finite())
            .unwrap_or("the last")
    }

    /// How wide dropout's mask is; none without a hidden layer after the
    /// trunk's pooling.
    #[must_use]
    pub fn dropout_width(&self) -> Option<usize> {
        self.head.hidden.last().map(|layer| layer.base.output().ncols())
    }
}

impl Learns for PointNet {
    fn parameters(&mut self, visit: &mut dyn FnMut(&mut Parameter)) {
        if let Some(stn) = &mut self.stn {
            stn.parameters(visit);
        }
        self.edges.iter_mut().for_each(|edge| edge.parameters(visit));
        self.stem.base.parameters(visit);
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
        self.edges.iter_mut().for_each(|edge| edge.statistics(visit));
        self.stem.base.statistics(visit);
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
        self.edges.iter().for_each(|edge| edge.folded(visit));
        self.stem.base.folded(visit);
        if let Some(fstn) = &self.fstn {
            fstn.folded(visit);
        }
        self.trunk.folded(visit);
        self.head.folded(visit);
    }
}
