//! The recipe of a run, a TOML file. Every key has a default: the baseline's
//! (yanx27/Pointnet_Pointnet2_pytorch, `train_classification.py`,
//! `provider.py`).

use std::path::{Path, PathBuf};

use formats::FormatError;
use formats::model_card::Normalization;
use infer_cpu::UNKNOWN;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::cluster::ClusterVariation;
use crate::cpl::Cpl;
use crate::error::Error;
use crate::shape::{Edge, Shape};

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Recipe {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Model file whose weights training starts from; random numbers if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub init: Option<PathBuf>,
    /// Passes over the training set.
    pub epochs: u32,
    /// Clouds of a batch; an incomplete batch at an epoch's end is left out.
    pub batch: usize,
    /// Points that the network sees.
    pub points: usize,
    /// How those points are chosen from a cloud that has more.
    pub sampling: Sampling,
    /// How clouds are moved and scaled: `unit-sphere`, or `metric` and
    /// `metric-sight` for clusters in
    /// metres, z up, with the sensor at the origin, of any number of points.
    #[serde(with = "by_name", skip_serializing_if = "is_default")]
    pub normalization: Normalization,
    /// How evenly an epoch's clouds are drawn from the classes: 0 as they come, 1 as
    /// many of each, and between these a class of n in proportion to n^(1 - balance).
    #[serde(skip_serializing_if = "is_default")]
    pub balance: f64,
    /// Clouds that are drawn for an epoch; as many as the training set has if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clouds_per_epoch: Option<usize>,
    /// The classes that the model answers as `unknown`. The temperature of its
    /// confidences is then fitted to the validation set.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknown: Vec<String>,
    /// The model answers `unknown`, too, to clouds whose energy is above that of this
    /// share of the validation clouds that it finds to be of its other classes; to no
    /// others if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_known: Option<f64>,
    /// Clouds of nothing in particular that are made for each epoch, over the clouds of
    /// the data: patches of ground, walls, blobs, pairs and slivers of objects. Their
    /// class, `unknown`, comes after those of the data.
    #[serde(skip_serializing_if = "is_default")]
    pub negatives: f64,
    /// The model drops outliers before it samples (infer-cpu's `outliers`), and so does
    /// its training, for clouds of the unit sphere.
    #[serde(skip_serializing_if = "is_default")]
    pub outlier_filter: bool,
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
    /// How clusters in metres are varied before that. Clouds of the unit sphere may have
    /// its density and strays, whose reach is then in radii.
    #[serde(skip_serializing_if = "is_default")]
    pub clusters: ClusterVariation,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            seed: 0,
            init: None,
            epochs: 200,
            batch: 24,
            points: 1024,
            sampling: Sampling::First,
            normalization: Normalization::UnitSphere,
            balance: 0.0,
            clouds_per_epoch: None,
            unknown: Vec::new(),
            keep_known: None,
            negatives: 0.0,
            outlier_filter: false,
            validation: 0.1,
            network: Shape::default(),
            cpl: None,
            dropout: 0.4,
            orthogonality: 0.001,
            label_smoothing: 0.0,
            adam: Adam::default(),
            schedule: Schedule::default(),
            augment: Augment::default(),
            clusters: ClusterVariation::default(),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// Values that files call by their names.
mod by_name {
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<T: Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(value)
    }

    pub fn deserialize<'de, T, D>(from: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        String::deserialize(from)?.parse().map_err(Error::custom)
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
    /// a sensor 3 radii away and 20 degrees above, from any side; for clusters in
    /// metres, the sensor at the origin.
    pub sensor_noise: f64,
    /// The largest angle about the up axis, degrees; 180 is any.
    pub rotate_degrees: f64,
    /// Share of clouds that are turned; the others keep the direction that they have in
    /// the data, which a network of aligned shapes does better with.
    #[serde(skip_serializing_if = "is_one")]
    pub rotate_share: f64,
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
            rotate_share: 1.0,
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

    /// Whether the model's card gets a temperature, and perhaps a largest energy,
    /// that are fitted to the validation set.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        !self.unknown.is_empty() || self.keep_known.is_some()
    }

    /// Whether clouds of the unit sphere are varied before points are chosen.
    #[must_use]
    pub fn varies_objects(&self) -> bool {
        let is_unit = self.normalization == Normalization::UnitSphere;
        is_unit && (self.outlier_filter || !is_default(&self.clusters))
    }

    /// The network's classes, for data of the classes `of_data`.
    #[must_use]
    pub fn classes(&self, of_data: &[String]) -> Vec<String> {
        let own = (self.negatives > 0.0).then(|| UNKNOWN.to_owned());
        of_data.iter().cloned().chain(own).collect()
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// [`Error::Recipe`] with the key.
    pub fn check(&self) -> Result<(), Error> {
        const SHARE: &str = "expected 0 or more, and less than 1";
        const WIDTHS: &str = "expected widths of 1 to 8192";
        let share = |x: f64| (0.0..1.0).contains(&x);
        let width = |width: usize| (1..=WIDEST).contains(&width);
        let Self { network, augment, adam, clusters, .. } = self;
        let is_metric = self.normalization.is_metric();
        let radius = |edge: &Edge| edge.radius.is_normal() && edge.radius > 0.0;
        let mut checks = vec![
            (self.epochs > 0, "epochs", "expected 1 or more"),
            (self.batch > 1, "batch", "expected 2 or more clouds, for the batch norms"),
            (self.points > 0, "points", "expected 1 or more"),
            (share(self.validation), "validation", SHARE),
            (share(self.dropout), "dropout", SHARE),
            (share(self.label_smoothing), "label_smoothing", SHARE),
            ((0.0..=1.0).contains(&self.balance), "balance", "expected 0 to 1"),
            (finite(self.orthogonality), "orthogonality", FINITE),
            (finite(adam.rate) && adam.rate > 0.0, "adam.rate", "expected a finite number above 0"),
            (network.trunk.len() > 1, "network.trunk", "expected 2 layers or more"),
            (network.t_net.len() > 1, "network.t_net", "expected 2 layers or more"),
            (!network.t_net_head.is_empty(), "network.t_net_head", "expected 1 layer or more"),
            (!network.head.is_empty(), "network.head", "expected 1 layer or more"),
            (network.widths().all(width), "network", WIDTHS),
            (
                network.edges.iter().all(radius),
                "network.edges.radius",
                "expected a finite number above 0",
            ),
            (
                network.edges.is_empty() || augment.cut_mix <= 0.0,
                "augment.cut_mix",
                "expected 0 with edges, because a mixed cloud has no neighborhood",
            ),
        ];
        if let Some(cpl) = &self.cpl {
            checks.extend([
                (cpl.front.len() > 1, "cpl.front", "expected 2 layers or more"),
                (cpl.front.iter().copied().all(width), "cpl.front", WIDTHS),
                ((1..=self.points).contains(&cpl.keep), "cpl.keep", "expected 1 to `points`"),
                (
                    !cpl.shared || network.input_transform,
                    "cpl.shared",
                    "expected `network.input_transform`, whose T-Net is shared",
                ),
                (!(cpl.gumbel && cpl.shared), "cpl.gumbel", "expected false with `cpl.shared`"),
                (
                    !cpl.gumbel || cpl.resize == "truncate",
                    "cpl.gumbel",
                    "expected `cpl.resize` to be truncate, because each point is drawn once",
                ),
                (finite(cpl.weight), "cpl.weight", FINITE),
            ]);
        }
        checks.extend([
            (
                self.normalization != Normalization::None,
                "normalization",
                "expected unit-sphere, metric or metric-sight",
            ),
            (
                is_metric || clusters.suits_whole_objects(),
                "clusters",
                "expected `normalization` to be metric or metric-sight, because clusters are in metres",
            ),
            (
                !is_metric || !self.outlier_filter,
                "outlier_filter",
                "expected false with `normalization` metric, where it was not measured to help",
            ),
            (finite(self.negatives), "negatives", FINITE),
            (
                self.negatives <= 0.0 || !is_metric && self.unknown == [UNKNOWN],
                "negatives",
                "expected `normalization` unit-sphere and `unknown = [\"unknown\"]` with it",
            ),
            (
                self.keep_known.is_none_or(|kept| kept > 0.0 && kept <= 1.0),
                "keep_known",
                "expected more than 0, up to 1",
            ),
            (
                self.validation > 0.0 || !self.is_calibrated(),
                "validation",
                "expected more than 0 with `unknown` or `keep_known`, which are fitted to it",
            ),
        ]);
        checks.extend(clusters.checks());
        let positive = |x: &f64| x.is_finite() && *x > 0.0;
        let angle = augment.rotate_degrees;
        checks.extend([
            (share(augment.drop), "augment.drop", SHARE),
            (
                augment.scale.iter().all(positive),
                "augment.scale",
                "expected two finite factors above 0",
            ),
            (finite(augment.shift), "augment.shift", FINITE),
            (finite(augment.jitter), "augment.jitter", FINITE),
            (finite(augment.sensor_noise), "augment.sensor_noise", FINITE),
            (share(augment.stretch), "augment.stretch", SHARE),
            ((0.0..=1.0).contains(&augment.cut_mix), "augment.cut_mix", "expected 0 to 1"),
            ((0.0..=180.0).contains(&angle), "augment.rotate_degrees", "expected 0 to 180"),
            (
                (0.0..=1.0).contains(&augment.rotate_share),
                "augment.rotate_share",
                "expected 0 to 1",
            ),
        ]);
        match checks.into_iter().find(|(holds, ..)| !holds) {
            Some((_, key, cause)) => Err(Error::Recipe { key, cause: cause.to_owned() }),
            None => Ok(()),
        }
    }
}

/// Whether `x` is a finite number of 0 or more.
pub(crate) fn finite(x: f64) -> bool {
    x.is_finite() && x >= 0.0
}

pub(crate) const FINITE: &str = "expected a finite number of 0 or more";

/// Wider layers are refused as a mistake.
const WIDEST: usize = 8192;
