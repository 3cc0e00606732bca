//! The recipe of a run: a TOML file. The default of every key is the baseline's setting
//! (yanx27/Pointnet_Pointnet2_pytorch, `train_classification.py`, `provider.py`).

use std::path::{Path, PathBuf};

use edgepuck_assets::TRAINING_RECIPES;
use formats::FormatError;
use formats::foreign::read_text;
use formats::model_card::Normalization;
use infer_cpu::UNKNOWN;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::cluster_variation::ClusterVariation;
use crate::cpl::Cpl;
use crate::error::Error;
use crate::limits::{Check, layers, non_negative, positive, share, share_below_1, widths};
use crate::shape::{Abstraction, Edge, Shape};

/// The settings of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Recipe {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Model file from whose weights training starts. If absent, training starts from random
    /// numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub init: Option<PathBuf>,
    /// Number of passes over the training set.
    pub epochs: u32,
    /// Number of clouds of a batch. An incomplete batch at the end of an epoch is left out.
    pub batch: usize,
    /// Number of points of a cloud for the network.
    pub points: usize,
    /// The choice of these points from a cloud that has more.
    pub sampling: Sampling,
    /// The normalisation of clouds: `unit-sphere`, or `metric` or `metric-sight` for clusters of
    /// any number of points in metres, z up, with the sensor at the origin.
    #[serde(with = "by_name", skip_serializing_if = "is_default")]
    pub normalization: Normalization,
    /// The balance of the classes in an epoch. The share of a class of n clouds is in proportion to
    /// n^(1 - balance): with 0 as in the data, with 1 equal for all classes.
    #[serde(skip_serializing_if = "is_default")]
    pub balance: f64,
    /// Number of clouds that are drawn for an epoch. If absent, it is the size of the training set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clouds_per_epoch: Option<usize>,
    /// The classes that the model answers as `unknown`. If there are any, the temperature of its
    /// confidences is fitted to the validation set.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknown: Vec<String>,
    /// The model also answers `unknown` if a cloud's energy is above a limit. The limit keeps this
    /// share of the validation clouds of known classes for which the model finds a known class. If
    /// absent, there is no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_known: Option<f64>,
    /// Number of clouds without an object that are made for each epoch, as a ratio to the number of
    /// clouds in the data. They are patches of ground, walls, blobs, pairs and slivers of objects.
    /// Their class, `unknown`, follows the classes of the data.
    #[serde(skip_serializing_if = "is_default")]
    pub negatives: f64,
    /// Whether the model drops outliers before it samples a cloud in the unit sphere. Training then
    /// drops them, too.
    #[serde(skip_serializing_if = "is_default")]
    pub outlier_filter: bool,
    /// Share of the training set's instances that are held out to choose the checkpoint. With 0,
    /// the last checkpoint is chosen.
    pub validation: f64,
    /// The network's layers.
    pub network: Shape,
    /// A Critical Points Layer before the network. The layer then takes `points` points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpl: Option<Cpl>,
    /// Share of the features of the last hidden layer that are dropped.
    pub dropout: f64,
    /// Weight of the feature transform's regulariser.
    pub orthogonality: f64,
    /// Share of the target that is distributed over all classes.
    pub label_smoothing: f64,
    /// Decay of the running mean of the weights over the steps, such as 0.999; it is lower in the first
    /// 10 / (1 - decay) steps. The model has the mean weights. With 0, it has those of the last step.
    #[serde(skip_serializing_if = "is_default")]
    pub average: f64,
    /// The optimiser.
    pub adam: Adam,
    /// The schedule of the learning rate; by default `step`, every 20 epochs by a factor of 0.7.
    pub schedule: Schedule,
    /// The augmentation of clouds.
    pub augment: Augment,
    /// The variation of clusters in metres before the augmentation. For clouds in the unit sphere,
    /// only density and strays apply, with the reach in radii.
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
            average: 0.0,
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

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde requires")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// Values that files state by name.
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

/// The choice of points from a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The first points, like the baseline's loader.
    First,
    /// Points drawn without replacement, anew in each epoch.
    Random,
    /// Farthest point sampling of a random half or more of the cloud, anew in each epoch.
    Fps,
}

/// The schedule of the learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Schedule {
    /// Multiplies the rate by a factor at regular intervals (PyTorch's `StepLR`).
    Step {
        /// Epochs between two steps.
        every: u32,
        /// The factor.
        factor: f64,
    },
    /// Raises the rate linearly, and then lowers it along half a cosine (Loshchilov and Hutter
    /// 2017).
    Cosine {
        /// Epochs of linear growth.
        warm_up: f64,
        /// The ratio of the last rate to the first.
        last: f64,
    },
}

impl Default for Schedule {
    fn default() -> Self {
        Self::Step { every: 20, factor: 0.7 }
    }
}

impl Schedule {
    /// The ratio of the rate to the first rate, `progress` epochs into a run of `epochs`.
    #[must_use]
    pub fn factor(self, progress: f64, epochs: u32) -> f64 {
        match self {
            // The baseline steps its scheduler before the first epoch, so that the rate falls one
            // epoch early.
            Self::Step { every, factor } => {
                factor.powi(((progress.floor() as u32 + 1) / every.max(1)) as i32)
            }
            Self::Cosine { warm_up, .. } if progress < warm_up => (progress + 0.01) / warm_up,
            Self::Cosine { warm_up, last } => {
                let done = (progress - warm_up) / (f64::from(epochs) - warm_up).max(1e-9);
                let half = 0.5 * (1.0 + libm::cos(std::f64::consts::PI * done.min(1.0)));
                last + (1.0 - last) * half
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
    /// Standard deviation of the normal shift of each point.
    pub jitter: f64,
    /// Limit to which jitter is clipped.
    pub jitter_clip: f64,
    /// Standard deviation of the sensor's error along the ray to each point. The sensor is at a
    /// distance of 3 radii, an elevation of 20 degrees and a random azimuth; for clusters in
    /// metres, it is at the origin.
    pub sensor_noise: f64,
    /// Largest angle of rotation about the up axis, degrees.
    pub rotate_degrees: f64,
    /// Share of clouds that are rotated. The others keep their direction in the data, with which a
    /// network of aligned shapes is more accurate.
    #[serde(skip_serializing_if = "is_one")]
    pub rotate_share: f64,
    /// The up axis: x, y or z.
    pub up: Axis,
    /// Largest difference from 1 of the uniform factor that stretches each axis.
    pub stretch: f64,
    /// Share of clouds in which a ball is replaced by points of another cloud, those nearest to the
    /// ball's centre (after PointCutMix-K: Zhang et al. 2022). The choice of points follows, so that
    /// neighborhoods are those of the mixed cloud.
    pub cut_mix: f64,
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "the names suffice")]
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
    /// Reads the recipe at `path`, or the built-in one of that name.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let built_in = TRAINING_RECIPES.iter().find(|(name, _)| Path::new(name) == path);
        let text = match built_in {
            Some((_, text)) => (*text).to_owned(),
            None if !path.exists() => {
                let names = TRAINING_RECIPES.map(|(name, _)| name).join(", ");
                let cause = format!("expected a recipe's file, or one of {names}");
                return Err(Error::Data { path: path.to_path_buf(), cause });
            }
            None => read_text(path, u64::MAX).map_err(|e| FormatError::io(path, e))?,
        };
        let recipe: Self = toml::from_str(&text)
            .map_err(|error| FormatError::malformed(path, "recipe", error.to_string().trim()))?;
        recipe.check()?;
        Ok(recipe)
    }

    /// The recipe as TOML, with all defaults.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string(self)
            .map_err(|error| Error::Recipe { key: "recipe", cause: error.to_string() })
    }

    /// Whether a temperature, and perhaps a largest energy, are fitted to the validation set.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        !self.unknown.is_empty() || self.keep_known.is_some()
    }

    /// Whether clouds in the unit sphere are varied before the choice of points.
    #[must_use]
    pub fn varies_objects(&self) -> bool {
        let is_unit = self.normalization == Normalization::UnitSphere;
        is_unit && (self.outlier_filter || !is_default(&self.clusters))
    }

    /// The network's classes for data with the classes `data_classes`.
    #[must_use]
    pub fn classes(&self, data_classes: &[String]) -> Vec<String> {
        let own = (self.negatives > 0.0).then(|| UNKNOWN.to_owned());
        data_classes.iter().cloned().chain(own).collect()
    }

    /// Checks that every value is within its limits.
    pub fn check(&self) -> Result<(), Error> {
        let Self { network, augment, clusters, .. } = self;
        let is_metric = self.normalization.is_metric();
        let radius = |edge: &Edge| edge.radius.is_normal() && edge.radius > 0.0;
        let mut checks: Vec<Check> = vec![
            (self.epochs > 0, "epochs", "expected 1 or more"),
            (self.batch > 1, "batch", "expected 2 or more clouds, for the batch norms"),
            (self.points > 0, "points", "expected 1 or more"),
            share_below_1("validation", self.validation),
            share_below_1("dropout", self.dropout),
            share_below_1("label_smoothing", self.label_smoothing),
            share("balance", self.balance),
            non_negative("orthogonality", self.orthogonality),
            positive("adam.rate", self.adam.rate),
            (self.adam.epsilon >= 1e-12, "adam.epsilon", "expected 1e-12 or more"),
            layers("network.trunk", network.trunk.len(), 2),
            layers("network.t_net", network.t_net.len(), 2),
            layers("network.t_net_head", network.t_net_head.len(), 1),
            layers("network.head", network.head.len(), 1),
            widths("network", network.widths()),
            (
                network.edges.iter().all(radius),
                "network.edges.radius",
                "expected a finite number above 0",
            ),
            share_below_1("average", self.average),
        ];
        let (abstractions, edges) = (&network.abstractions, &network.edges);
        let has_t_nets = network.input_transform || network.feature_transform;
        let is_sound = |a: &Abstraction| {
            (1..=1 << 16).contains(&a.centres)
                && a.radius.is_normal()
                && a.radius > 0.0
                && !a.widths.is_empty()
        };
        checks.extend([
            (
                abstractions.iter().all(is_sound)
                    && abstractions.is_sorted_by(|a, b| a.centres >= b.centres),
                "network.abstractions",
                "expected 1 to 65536 centres, no more than before, a radius above 0, 1 layer or more",
            ),
            (
                abstractions.is_empty() || !has_t_nets && edges.is_empty() && self.cpl.is_none(),
                "network.abstractions",
                "expected none beside T-Nets, edges or a Critical Points Layer",
            ),
        ]);
        if let Some(cpl) = &self.cpl {
            checks.extend([
                layers("cpl.front", cpl.front.len(), 2),
                widths("cpl.front", cpl.front.iter().copied()),
                ((1..=self.points).contains(&cpl.keep), "cpl.keep", "expected 1 to `points`"),
                non_negative("cpl.weight", cpl.weight),
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
            non_negative("negatives", self.negatives),
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
        checks.extend([
            share_below_1("augment.drop", augment.drop),
            (
                augment.scale.iter().all(|factor| factor.is_finite() && *factor > 0.0)
                    && augment.scale.is_sorted(),
                "augment.scale",
                "expected two finite factors above 0, ascending",
            ),
            non_negative("augment.shift", augment.shift),
            non_negative("augment.jitter", augment.jitter),
            non_negative("augment.sensor_noise", augment.sensor_noise),
            share_below_1("augment.stretch", augment.stretch),
            share("augment.cut_mix", augment.cut_mix),
            (
                (0.0..=180.0).contains(&augment.rotate_degrees),
                "augment.rotate_degrees",
                "expected 0 to 180",
            ),
            share("augment.rotate_share", augment.rotate_share),
        ]);
        match checks.into_iter().find(|(holds, ..)| !holds) {
            Some((_, key, cause)) => Err(Error::Recipe { key, cause: cause.to_owned() }),
            None => Ok(()),
        }
    }
}
