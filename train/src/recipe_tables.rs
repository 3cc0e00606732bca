//! The tables of a recipe: the network, the schedule and the variation of clouds.

use serde::{Deserialize, Serialize};

formats::named! {
    /// The choice of points from a cloud.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Sampling: "sampling" {
        /// The first points, like the baseline's loader.
        First = "first",
        /// Points drawn without replacement, anew in each epoch.
        Random = "random",
        /// Farthest point sampling of a random half or more of the cloud, anew in each epoch.
        Fps = "fps",
    }
}

/// The schedule of the learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Schedule {
    /// Multiplies the rate by 0.7 at regular intervals (PyTorch's `StepLR`).
    Step {
        /// Epochs between two steps.
        every: u32,
    },
    /// Raises the rate linearly, and then lowers it along half a cosine to a hundredth (Loshchilov
    /// and Hutter 2017).
    Cosine {
        /// Epochs of linear growth.
        warm_up: f64,
    },
}

impl Default for Schedule {
    fn default() -> Self {
        Self::Step { every: 20 }
    }
}

impl Schedule {
    /// The ratio of the rate to the first rate, `progress` epochs into a run of `epochs`.
    #[must_use]
    pub fn factor(self, progress: f64, epochs: u32) -> f64 {
        match self {
            // The baseline steps its scheduler before the first epoch, so that the rate falls one
            // epoch early.
            Self::Step { every } => {
                0.7f64.powi(((progress.floor() as u32 + 1) / every.max(1)) as i32)
            }
            Self::Cosine { warm_up } if progress < warm_up => (progress + 0.01) / warm_up,
            Self::Cosine { warm_up } => {
                const LAST: f64 = 0.01;
                let done = (progress - warm_up) / (f64::from(epochs) - warm_up).max(1e-9);
                let half = 0.5 * (1.0 + libm::cos(std::f64::consts::PI * done.min(1.0)));
                LAST + (1.0 - LAST) * half
            }
        }
    }
}

/// The augmentation of clouds in training. A value of 0 disables its step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Augment {
    /// Largest share of points that are dropped. Each cloud's share is uniform from 0 to this
    /// value.
    pub drop: f64,
    /// Smallest and largest scale. The scale is uniform.
    pub scale: [f64; 2],
    /// Largest shift along each axis.
    pub shift: f64,
    /// Standard deviation of the normal shift of each point, which is clipped to 0.05.
    pub jitter: f64,
    /// Standard deviation of the sensor's error along the ray to each point of a cluster, metres.
    pub sensor_noise: f64,
    /// Largest angle of rotation about z, degrees.
    pub rotate_degrees: f64,
    /// Largest difference from 1 of the uniform factor that stretches each axis.
    pub stretch: f64,
}

impl Default for Augment {
    fn default() -> Self {
        Self {
            drop: 0.875,
            scale: [0.8, 1.25],
            shift: 0.1,
            jitter: 0.0,
            sensor_noise: 0.0,
            rotate_degrees: 0.0,
            stretch: 0.0,
        }
    }
}

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
    /// The EdgeConv layers, whose features are appended to the coordinates.
    pub edges: Vec<Edge>,
    /// Output widths of the point-wise layers. The last layer is pooled.
    pub trunk: Vec<usize>,
    /// Output widths of the hidden layers after the pooling.
    pub head: Vec<usize>,
}

impl Default for Shape {
    /// The baseline's network (yanx27/Pointnet_Pointnet2_pytorch, `pointnet_cls`) without its
    /// T-Nets.
    fn default() -> Self {
        Self { edges: Vec::new(), trunk: vec![64, 128, 1024], head: vec![512, 256] }
    }
}

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

/// How training varies clusters in metres, so that they resemble clusters of other sensors,
/// distances and segmentations. The default varies nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClusterVariation {
    /// Smallest and largest number of points that a cluster keeps. The number is drawn
    /// log-uniformly, and the other points are dropped before the centring. If absent, all points
    /// stay.
    pub density: Option<[usize; 2]>,
    /// Largest height, metres, of the part that is cut off a cluster's foot.
    pub cut: f64,
    /// Share of clusters that get up to five points of other things, within half a metre.
    pub stray_share: f64,
    /// Share of clusters that get strips of the ground, as if a segmentation had left them. The
    /// height of the ground is then taken as unknown for three clusters of ten.
    pub ground_share: f64,
}
