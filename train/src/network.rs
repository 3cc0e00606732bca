//! PointNet for classification, forward and backward.
//!
//! Names of parameters are those of yanx27's `pointnet_cls`, which infer-cpu
//! reads: `feat.stn.conv1.weight`, `feat.fstn.bn4.bias`, `fc3.weight`, ….

use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::layer::{Folded, Learns, PointLayer, orthogonality};
use crate::loss::{self, Loss};
use crate::matrix::Matrix;
use crate::parameter::Parameter;
use crate::stack::{Points, Vectors};
use crate::t_net::TNet;

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
        let head = Vectors::new("", &[&[pooled], &shape.head[..], &[n_classes]].concat(), 0, seed);
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
