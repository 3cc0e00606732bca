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
    /// Output widths of the trunk's point-wise layers. The last layer is pooled.
    pub trunk: Vec<usize>,
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
