//! The layers of a network and their widths.

use serde::{Deserialize, Serialize};

/// An EdgeConv layer: features of each point's neighborhood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// The radius of the neighborhood, in units of the normalised cloud.
    pub radius: f32,
    /// The number of features for each point.
    pub channels: usize,
}

/// A separable set abstraction: features of the neighborhoods of a few centres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Abstraction {
    /// The number of centres, which are farthest points.
    pub centres: usize,
    /// The radius of a centre's neighborhood, in units of the normalised cloud.
    pub radius: f32,
    /// Output widths of the layers after the pooling over a neighborhood.
    pub widths: Vec<usize>,
}

/// The layers of a network and their widths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shape {
    /// Whether the network has a T-Net of the coordinates.
    pub input_transform: bool,
    /// Whether the network has a T-Net of the first layer's features.
    pub feature_transform: bool,
    /// The EdgeConv layers, whose features are appended to the coordinates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<Edge>,
    /// Output widths of the trunk's point-wise layers. The last layer is pooled: over the cloud, or
    /// over the neighborhoods of the first abstraction's centres.
    pub trunk: Vec<usize>,
    /// The set abstractions after the trunk, each with fewer centres. The features of the last
    /// one's centres are pooled by their maximum and their mean.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub abstractions: Vec<Abstraction>,
    /// Output widths of a T-Net's point-wise layers. The last layer is pooled.
    pub t_net: Vec<usize>,
    /// Output widths of a T-Net's hidden layers after the pooling.
    pub t_net_head: Vec<usize>,
    /// Output widths of the hidden layers after the trunk's pooling.
    pub head: Vec<usize>,
}

impl Default for Shape {
    /// The baseline's network (yanx27/Pointnet_Pointnet2_pytorch, `pointnet_cls`).
    fn default() -> Self {
        Self {
            input_transform: true,
            feature_transform: true,
            edges: Vec::new(),
            trunk: vec![64, 128, 1024],
            abstractions: Vec::new(),
            t_net: vec![64, 128, 1024],
            t_net_head: vec![512, 256],
            head: vec![512, 256],
        }
    }
}

impl Shape {
    /// All widths.
    pub fn widths(&self) -> impl Iterator<Item = usize> {
        let Self { edges, trunk, abstractions, t_net, t_net_head, head, .. } = self;
        let edges = edges.iter().map(|edge| edge.channels);
        let abstractions = abstractions.iter().map(|abstraction| &abstraction.widths);
        let layers = [trunk, t_net, t_net_head, head].into_iter().chain(abstractions);
        layers.flatten().copied().chain(edges)
    }
}
