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
}

impl Default for Cpl {
    /// The paper's encoder and its 64 points (Meyer and Reitmann 2026).
    fn default() -> Self {
        let front = vec![64, 128, 1024];
        Self { front, keep: 64, weight: 1.0 }
    }
}
