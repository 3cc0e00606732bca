//! The layers of a network and their widths.

use serde::{Deserialize, Serialize};

/// An EdgeConv layer: features of each point's neighborhood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// Radius of the neighborhood, in the unit of normalised clouds.
    pub radius: f32,
    /// Features that it computes for each point.
    pub channels: usize,
}

/// The layers of a network and their widths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shape {
    /// The T-Net of the coordinates.
    pub input_transform: bool,
    /// The T-Net of the first layer's features.
    pub feature_transform: bool,
    /// The EdgeConv layers, whose features are appended to the coordinates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<Edge>,
    /// Outputs of the trunk's point-wise layers, the last pooled.
    pub trunk: Vec<usize>,
    /// Outputs of a T-Net's point-wise layers, the last pooled.
    pub t_net: Vec<usize>,
    /// Outputs of a T-Net's layers after the pooling.
    pub t_net_head: Vec<usize>,
    /// Outputs of the layers after the trunk's pooling, except the last.
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
