//! Samples of a fixed number of points of a scan.

use formats::rng::StreamKey;
use serde::{Deserialize, Serialize};

use super::MAX_RAYS;
use crate::config::{InvalidValue, within};

/// The number of points to sample from a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// The number of points drawn.
    pub points: u32,
    /// Whether a point may be drawn repeatedly; if not, a scan of fewer points keeps them all.
    pub with_replacement: bool,
    /// The number of points drawn before the points are snapped to rings: without replacement from
    /// a scan that has as many, with replacement from a smaller one (ModelNet40-C, `occlusion_1`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before_rings: Option<u32>,
}

impl Sample {
    /// The indices of the points to keep of `n_available`, in the order drawn.
    #[must_use]
    pub fn draw(&self, n_available: u32, key: StreamKey) -> Vec<u32> {
        if self.with_replacement {
            draw_with_replacement(n_available, self.points, key)
        } else {
            draw_without_replacement(n_available, self.points, key)
        }
    }

    /// As [`Sample::draw`], before the rings: all points unless the profile asks for such a draw.
    #[must_use]
    pub fn draw_before_rings(&self, n_available: u32, key: StreamKey) -> Vec<u32> {
        match self.before_rings {
            None => (0..n_available).collect(),
            Some(points) if points <= n_available => {
                draw_without_replacement(n_available, points, key)
            }
            Some(points) => draw_with_replacement(n_available, points, key),
        }
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        within("sample.points", f64::from(self.points), 1.0..=MAX_RAYS as f64)?;
        within("sample.before_rings", self.before_rings.map(f64::from), 1.0..=MAX_RAYS as f64)
    }
}

/// `n_drawn` independent indices below `n_available`; none if that is 0.
fn draw_with_replacement(n_available: u32, n_drawn: u32, key: StreamKey) -> Vec<u32> {
    if n_available == 0 {
        return Vec::new();
    }
    (0..n_drawn).map(|n| key.below(u64::from(n_available), u64::from(n)) as u32).collect()
}

/// `n_drawn` different indices below `n_available`, or all if there are fewer:
/// the first steps of a Fisher-Yates shuffle.
fn draw_without_replacement(n_available: u32, n_drawn: u32, key: StreamKey) -> Vec<u32> {
    let mut indices: Vec<u32> = (0..n_available).collect();
    let n_drawn = n_drawn.min(n_available);
    for n in 0..n_drawn {
        let left = u64::from(n_available - n);
        indices.swap(n as usize, n as usize + key.below(left, u64::from(n)) as usize);
    }
    indices.truncate(n_drawn as usize);
    indices
}
