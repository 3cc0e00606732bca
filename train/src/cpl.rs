//! The settings of a Critical Points Layer in a recipe.

use serde::{Deserialize, Serialize};

/// The settings of a Critical Points Layer: its point encoder and its selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cpl {
    /// Output widths of the encoder's point-wise layers. The last layer is pooled.
    pub front: Vec<usize>,
    /// The number of selected points; fewer, if fewer are critical.
    pub keep: usize,
    /// The weight of the encoder's own loss.
    pub weight: f64,
    /// Whether the network's input T-Net is the encoder. Its pooling over all points then selects
    /// the points for the other layers and predicts their transform; `front` and `weight` are
    /// unused.
    pub shared: bool,
    /// Whether points are drawn with probabilities in proportion to their scores, and the network's
    /// loss trains the encoder by a straight-through estimator.
    pub gumbel: bool,
}

impl Default for Cpl {
    /// The paper's encoder and its 64 points (Meyer and Reitmann 2026).
    fn default() -> Self {
        let front = vec![64, 128, 1024];
        Self { front, keep: 64, weight: 1.0, shared: false, gumbel: false }
    }
}
