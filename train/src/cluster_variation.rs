//! The variation of clusters in training: the table `clusters` of a recipe.

use serde::{Deserialize, Serialize};

use crate::limits::{Check, non_negative, share};

/// How training varies clusters in metres, so that they resemble clusters of other sensors,
/// distances and segmentations. The default varies nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClusterVariation {
    /// Smallest and largest number of points that a cluster keeps. The number is drawn
    /// log-uniformly, and the other points are dropped before the centring. If absent, all points
    /// stay.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<[usize; 2]>,
    /// Largest height, metres, of the part that is cut off a cluster's foot.
    pub cut: f64,
    /// Share of clusters that get points of other things.
    pub stray_share: f64,
    /// Largest number of such points.
    pub strays: usize,
    /// Largest distance of such points from the cluster's box, metres.
    pub stray_reach: f64,
    /// Share of clusters that get strips of the ground, as if a segmentation had left them.
    pub ground_share: f64,
    /// Largest distance of such strips from the cluster's box, metres.
    pub ground_reach: f64,
    /// Share of clusters for which the height of the ground is taken as unknown.
    pub ground_unknown: f64,
}

impl ClusterVariation {
    /// Whether all variations that it has also apply to clouds of the unit sphere.
    pub(crate) fn suits_whole_objects(&self) -> bool {
        let Self { cut, ground_share, ground_reach, ground_unknown, .. } = *self;
        [cut, ground_share, ground_reach, ground_unknown] == [0.0; 4]
    }

    pub(crate) fn checks(&self) -> [Check; 8] {
        let ordered = |[least, most]: [usize; 2]| (1..=most).contains(&least);
        [
            (
                self.density.is_none_or(ordered),
                "clusters.density",
                "expected two numbers, 1 or more, ascending",
            ),
            non_negative("clusters.cut", self.cut),
            share("clusters.stray_share", self.stray_share),
            (
                self.stray_share <= 0.0 || self.strays > 0,
                "clusters.strays",
                "expected 1 or more with `stray_share`",
            ),
            non_negative("clusters.stray_reach", self.stray_reach),
            share("clusters.ground_share", self.ground_share),
            non_negative("clusters.ground_reach", self.ground_reach),
            share("clusters.ground_unknown", self.ground_unknown),
        ]
    }
}
