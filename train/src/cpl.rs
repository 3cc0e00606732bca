//! What a recipe says of a Critical Points Layer.

use serde::{Deserialize, Serialize};

/// A Critical Points Layer: its point encoder, and the points it selects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cpl {
    /// Outputs of the encoder's point-wise layers, the last pooled.
    pub front: Vec<usize>,
    /// Points that it selects.
    pub keep: usize,
    /// How a selection of another size becomes this size: truncate, cyclic,
    /// nearest or weighted.
    pub resize: String,
    /// The weight of the encoder's own loss.
    pub weight: f64,
    /// Whether the network's T-Net of coordinates is the encoder, instead of one
    /// of its own: its pooling of all points selects those that the rest of the
    /// network sees, and predicts their transform. `front` and `weight` are then
    /// unused.
    pub shared: bool,
    /// Whether points are drawn at random, in proportion to their scores, and
    /// the network's loss trains the encoder by a straight-through estimator.
    pub gumbel: bool,
}

impl Default for Cpl {
    /// The paper's encoder (Meyer and Reitmann 2026), and its 64 points.
    fn default() -> Self {
        let resize = "truncate".to_owned();
        let front = vec![64, 128, 1024];
        Self { front, keep: 64, resize, weight: 1.0, shared: false, gumbel: false }
    }
}
