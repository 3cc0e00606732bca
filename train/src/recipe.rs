//! The recipe of a run, a TOML file. Every key has a default: the baseline's
//! (yanx27/Pointnet_Pointnet2_pytorch, `train_classification.py`,
//! `provider.py`).

use std::path::Path;

use formats::FormatError;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::cpl::Cpl;
use crate::error::Error;
use crate::shape::Shape;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Recipe {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Passes over the training set.
    pub epochs: u32,
    /// Clouds of a batch; an incomplete batch at an epoch's end is left out.
    pub batch: usize,
    /// Points that the network sees.
    pub points: usize,
    /// How those points are chosen from a cloud that has more.
    pub sampling: Sampling,
    /// Share of the training set's instances that choose the checkpoint; with 0
    /// the last checkpoint is taken.
    pub validation: f64,
    /// The network's layers.
    pub network: Shape,
    /// A Critical Points Layer before the network, which then sees `points`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpl: Option<Cpl>,
    /// Share of the last hidden layer's features that are dropped.
    pub dropout: f64,
    /// Weight of the feature transform's regulariser.
    pub orthogonality: f64,
    /// Share of the target that is spread over all classes.
    pub label_smoothing: f64,
    /// The optimiser.
    pub adam: Adam,
    /// How the learning rate falls.
    pub schedule: Schedule,
    /// How clouds are augmented.
    pub augment: Augment,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            seed: 0,
            epochs: 200,
            batch: 24,
            points: 1024,
            sampling: Sampling::First,
            validation: 0.1,
            network: Shape::default(),
            cpl: None,
            dropout: 0.4,
            orthogonality: 0.001,
            label_smoothing: 0.0,
            adam: Adam::default(),
            schedule: Schedule::default(),
            augment: Augment::default(),
        }
    }
}

/// Which points of a cloud are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The first, as the baseline's loader.
    First,
    /// Drawn without replacement, anew in each epoch.
    Random,
    /// Farthest point sampling of a random half or more of the cloud, anew in
    /// each epoch.
    Fps,
}

/// How the learning rate falls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Schedule {
    /// By a factor every so many epochs (PyTorch's `StepLR`).
    Step {
        /// Epochs between.
        every: u32,
        /// The factor.
        factor: f64,
    },
    /// Along half a cosine to `last` of the first rate, after epochs of linear
    /// growth (Loshchilov and Hutter 2017).
    Cosine {
        /// Epochs of growth.
        warm_up: f64,
        /// The last rate over the first.
        last: f64,
    },
}

impl Default for Schedule {
    fn default() -> Self {
        Self::Step { every: 20, factor: 0.7 }
    }
}

impl Schedule {
    /// The rate divided by the first rate, `progress` epochs into a run of
    /// `epochs`.
    #[must_use]
    pub fn factor(self, progress: f64, epochs: u32) -> f64 {
        match self {
            // The baseline steps its scheduler before its first epoch, so that
            // the rate falls a whole epoch early.
            Self::Step { every, factor } => {
                factor.powi(((progress.floor() as u32 + 1) / every.max(1)) as i32)
            }
            Self::Cosine { warm_up, .. } if progress < warm_up => (progress + 0.01) / warm_up,
            Self::Cosine { warm_up, last } => {
                let done = (progress - warm_up) / (f64::from(epochs) - warm_up).max(1e-9);
                let half = 0.5 * (1.0 + (std::f64::consts::PI * done.min(1.0)).cos());
                last + (1.0 - last) * half
            }
        }
    }
}

/// How clouds are augmented in training. A value of 0 switches its step off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Augment {
    /// The largest share of points that are dropped; each cloud's share is
    /// uniform below it.
    pub drop: f64,
    /// The range of the scale, which is uniform.
    pub scale: [f64; 2],
    /// The largest shift along each axis.
    pub shift: f64,
    /// Standard deviation of a normal shift of each point.
    pub jitter: f64,
    /// Where jitter is clipped.
    pub jitter_clip: f64,
    /// Standard deviation of a sensor's error, along the ray to each point, for
    /// a sensor 3 radii away and 20 degrees above, from any side.
    pub sensor_noise: f64,
    /// The largest angle about the up axis, degrees; 180 is any.
    pub rotate_degrees: f64,
    /// The up axis: x, y or z.
    pub up: Axis,
    /// Each axis is stretched by a factor that is uniform in 1 ± this.
    pub stretch: f64,
    /// Share of clouds of which a part is replaced by another cloud's
    /// (PointCutMix-R: Zhang et al. 2022).
    pub cut_mix: f64,
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "the names say all")]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Default for Augment {
    fn default() -> Self {
        Self {
            drop: 0.875,
            scale: [0.8, 1.25],
            shift: 0.1,
            jitter: 0.0,
            jitter_clip: 0.05,
            sensor_noise: 0.0,
            rotate_degrees: 0.0,
            up: Axis::Z,
            stretch: 0.0,
            cut_mix: 0.0,
        }
    }
}

impl Recipe {
    /// Reads the recipe at `path`.
    ///
    /// # Errors
    /// A file that is not TOML or has unknown keys; as [`Recipe::check`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| FormatError::io(path, source))?;
        let recipe: Self = toml::from_str(&text)
            .map_err(|error| FormatError::malformed(path, "recipe", error.to_string().trim()))?;
        recipe.check()?;
        Ok(recipe)
    }

    /// The recipe as TOML, every default spelled out.
    ///
    /// # Errors
    /// [`Error::Recipe`] with what TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string(self)
            .map_err(|error| Error::Recipe { key: "recipe", cause: error.to_string() })
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// [`Error::Recipe`] with the key.
    pub fn check(&self) -> Result<(), Error> {
        let refuse = |key, cause: &str| Err(Error::Recipe { key, cause: cause.to_owned() });
        let share = |x: f64| (0.0..1.0).contains(&x);
        let finite = |x: f64| x.is_finite() && x >= 0.0;
        let Self { network, augment, .. } = self;
        match self {
            _ if self.epochs == 0 => refuse("epochs", "expected 1 or more"),
            _ if self.batch < 2 => {
                refuse("batch", "expected 2 or more clouds, for the batch norms")
            }
            _ if self.points == 0 => refuse("points", "expected 1 or more"),
            _ if !share(self.validation) => {
                refuse("validation", "expected 0 or more, and less than 1")
            }
            _ if !share(self.dropout) => refuse("dropout", "expected 0 or more, and less than 1"),
            _ if !share(self.label_smoothing) => {
                refuse("label_smoothing", "expected 0 or more, and less than 1")
            }
            _ if !finite(self.orthogonality) => {
                refuse("orthogonality", "expected a finite number of 0 or more")
            }
            _ if !(self.adam.rate.is_finite() && self.adam.rate > 0.0) => {
                refuse("adam.rate", "expected a finite number above 0")
            }
            _ if network.trunk.len() < 2 => refuse("network.trunk", "expected 2 layers or more"),
            _ if network.t_net.len() < 2 => refuse("network.t_net", "expected 2 layers or more"),
            _ if network.t_net_head.is_empty() => {
                refuse("network.t_net_head", "expected 1 layer or more")
            }
            _ if network.head.is_empty() => refuse("network.head", "expected 1 layer or more"),
            _ if network.widths().any(|width| width == 0 || width > WIDEST) => {
                refuse("network", "expected widths of 1 to 8192")
            }
            _ if network
                .edges
                .iter()
                .any(|edge| !(edge.radius.is_normal() && edge.radius > 0.0)) =>
            {
                refuse("network.edges.radius", "expected a finite number above 0")
            }
            _ if !network.edges.is_empty() && augment.cut_mix > 0.0 => refuse(
                "augment.cut_mix",
                "expected 0 with edges, because a mixed cloud has no neighborhood",
            ),
            _ if self.cpl.as_ref().is_some_and(|cpl| cpl.front.len() < 2) => {
                refuse("cpl.front", "expected 2 layers or more")
            }
            _ if self.cpl.iter().flat_map(|cpl| &cpl.front).any(|w| *w == 0 || *w > WIDEST) => {
                refuse("cpl.front", "expected widths of 1 to 8192")
            }
            _ if self.cpl.as_ref().is_some_and(|cpl| cpl.keep == 0 || cpl.keep > self.points) => {
                refuse("cpl.keep", "expected 1 to `points`")
            }
            _ if self.cpl.as_ref().is_some_and(|cpl| cpl.shared) && !network.input_transform => {
                refuse("cpl.shared", "expected `network.input_transform`, whose T-Net is shared")
            }
            _ if self.cpl.as_ref().is_some_and(|cpl| cpl.gumbel && cpl.shared) => {
                refuse("cpl.gumbel", "expected false with `cpl.shared`")
            }
            _ if self.cpl.as_ref().is_some_and(|cpl| cpl.gumbel && cpl.resize != "truncate") => {
                refuse(
                    "cpl.gumbel",
                    "expected `cpl.resize` to be truncate, because each point is drawn once",
                )
            }
            _ if self.cpl.as_ref().is_some_and(|cpl| !finite(cpl.weight)) => {
                refuse("cpl.weight", "expected a finite number of 0 or more")
            }
            _ if !(share(augment.drop)) => {
                refuse("augment.drop", "expected 0 or more, and less than 1")
            }
            _ if !augment.scale.iter().all(|x| x.is_finite() && *x > 0.0) => {
                refuse("augment.scale", "expected two finite factors above 0")
            }
            _ if !finite(augment.shift) => {
                refuse("augment.shift", "expected a finite number of 0 or more")
            }
            _ if !finite(augment.jitter) => {
                refuse("augment.jitter", "expected a finite number of 0 or more")
            }
            _ if !finite(augment.sensor_noise) => {
                refuse("augment.sensor_noise", "expected a finite number of 0 or more")
            }
            _ if !share(augment.stretch) => {
                refuse("augment.stretch", "expected 0 or more, and less than 1")
            }
            _ if !(0.0..=1.0).contains(&augment.cut_mix) => {
                refuse("augment.cut_mix", "expected 0 to 1")
            }
            _ if !(0.0..=180.0).contains(&augment.rotate_degrees) => {
                refuse("augment.rotate_degrees", "expected 0 to 180")
            }
            _ => Ok(()),
        }
    }
}

/// Wider layers are refused as a mistake.
const WIDEST: usize = 8192;
