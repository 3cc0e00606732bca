//! The recipe of a run: a TOML file. The default of every key is the baseline's setting
//! (yanx27/Pointnet_Pointnet2_pytorch, `train_classification.py`, `provider.py`).

use std::path::{Path, PathBuf};

use edgepuck_assets::TRAINING_RECIPES;
use formats::mistakes::Mistakes;
use formats::model_card::Normalization;
use formats::plausible::{foreign_toml, read_text};
use formats::{FormatError, InvalidValue};
use serde::{Deserialize, Serialize};

use crate::error::Error;
pub use crate::recipe_tables::{Augment, ClusterVariation, Cpl, Edge, Sampling, Schedule, Shape};

/// The settings of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Recipe {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Model file from whose weights training starts. If absent, training starts from random
    /// numbers.
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
    pub normalization: Normalization,
    /// The balance of the classes in an epoch. The share of a class of n clouds is in proportion to
    /// n^(1 - balance): with 0 as in the data, with 1 equal for all classes.
    pub balance: f64,
    /// Number of clouds that are drawn for an epoch. If absent, it is the size of the training set.
    pub clouds_per_epoch: Option<usize>,
    /// The classes that the model answers as `unknown`. If there are any, the temperature of its
    /// confidences is fitted to the validation set.
    pub unknown: Vec<String>,
    /// Share of the training set's instances that are held out to choose the checkpoint. With 0,
    /// the last checkpoint is chosen.
    pub validation: f64,
    /// The network's layers.
    pub network: Shape,
    /// A Critical Points Layer before the network. The layer then takes `points` points.
    pub cpl: Option<Cpl>,
    /// Share of the features of the last hidden layer that are dropped.
    pub dropout: f64,
    /// Share of the target that is distributed over all classes.
    pub label_smoothing: f64,
    /// Learning rate of Adam before the schedule.
    pub rate: f64,
    /// The schedule of the learning rate; by default `step`, every 20 epochs.
    pub schedule: Schedule,
    /// The augmentation of clouds.
    pub augment: Augment,
    /// The variation of clusters in metres before the augmentation.
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
            validation: 0.1,
            network: Shape::default(),
            cpl: None,
            dropout: 0.4,
            label_smoothing: 0.0,
            rate: 1e-3,
            schedule: Schedule::default(),
            augment: Augment::default(),
            clusters: ClusterVariation::default(),
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
                return Err(Error::data(path, cause));
            }
            None => read_text(path, u64::MAX).map_err(|e| FormatError::io(path, e))?,
        };
        let checked = |recipe: Self| recipe.check().map(|()| recipe).map_err(Vec::from);
        Mistakes::find(&text, checked).map_err(|mistakes| {
            let other = foreign_toml(&text, "a recipe of a training");
            Error::data(path, other.unwrap_or_else(|| mistakes.to_string()))
        })
    }

    /// The recipe as TOML, with all defaults.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string(self).map_err(|error| InvalidValue::new("recipe", error.to_string()).into())
    }

    /// Checks that every value is within its limits.
    pub fn check(&self) -> Result<(), InvalidValue> {
        let Self { network, augment, clusters, .. } = self;
        let is_metric = self.normalization.is_metric();
        let is_width = |width: usize| (1..=8192).contains(&width);
        let is_scale = |factor: &f64| factor.is_finite() && *factor > 0.0;
        let is_range = |[least, most]: [usize; 2]| (1..=most).contains(&least);
        let layers = network.trunk.iter().chain(&network.head).copied();
        let channels = network.edges.iter().map(|edge| edge.channels);
        let above_0 = "expected a finite number above 0";
        let widths = "expected widths of 1 to 8192";
        let mut checks = vec![
            ("epochs", self.epochs > 0, "expected 1 or more"),
            ("batch", self.batch > 1, "expected 2 or more clouds, for the batch norms"),
            ("points", self.points > 0, "expected 1 or more"),
            ("rate", self.rate.is_finite() && self.rate > 0.0, above_0),
            ("network.trunk", network.trunk.len() > 1, "expected 2 layers or more"),
            ("network.head", !network.head.is_empty(), "expected 1 layer or more"),
            ("network", layers.chain(channels).all(is_width), widths),
            (
                "network.edges.radius",
                network.edges.iter().all(|edge| edge.radius.is_normal() && edge.radius > 0.0),
                above_0,
            ),
            (
                "normalization",
                self.normalization != Normalization::None,
                "expected unit-sphere, metric or metric-sight",
            ),
            (
                "clusters",
                is_metric || *clusters == ClusterVariation::default(),
                "expected `normalization` to be metric or metric-sight, because clusters are in metres",
            ),
            (
                "augment.sensor_noise",
                is_metric || augment.sensor_noise == 0.0,
                "expected 0 for clouds in the unit sphere, which have no sensor",
            ),
            (
                "validation",
                self.validation > 0.0 || self.unknown.is_empty(),
                "expected more than 0 with `unknown`, whose temperature is fitted to it",
            ),
            (
                "clusters.density",
                clusters.density.is_none_or(is_range),
                "expected two numbers, 1 or more, ascending",
            ),
            (
                "augment.scale",
                augment.scale.iter().all(is_scale) && augment.scale.is_sorted(),
                "expected two finite factors above 0, ascending",
            ),
            (
                "augment.rotate_degrees",
                (0.0..=180.0).contains(&augment.rotate_degrees),
                "expected 0 to 180",
            ),
        ];
        let mut not_negative = vec![
            ("augment.shift", augment.shift),
            ("augment.jitter", augment.jitter),
            ("augment.sensor_noise", augment.sensor_noise),
            ("clusters.cut", clusters.cut),
        ];
        if let Some(cpl) = &self.cpl {
            checks.extend([
                ("cpl.front", cpl.front.len() > 1, "expected 2 layers or more"),
                ("cpl.front", cpl.front.iter().copied().all(is_width), widths),
                ("cpl.keep", (1..=self.points).contains(&cpl.keep), "expected 1 to `points`"),
            ]);
            not_negative.push(("cpl.weight", cpl.weight));
        }
        let is_finite = |(key, x): (_, f64)| {
            (key, x.is_finite() && x >= 0.0, "expected a finite number of 0 or more")
        };
        checks.extend(not_negative.into_iter().map(is_finite));
        let shares = [
            ("balance", self.balance),
            ("clusters.stray_share", clusters.stray_share),
            ("clusters.ground_share", clusters.ground_share),
        ];
        checks.extend(shares.map(|(key, x)| (key, (0.0..=1.0).contains(&x), "expected 0 to 1")));
        let below_1 = [
            ("validation", self.validation),
            ("dropout", self.dropout),
            ("label_smoothing", self.label_smoothing),
            ("augment.drop", augment.drop),
            ("augment.stretch", augment.stretch),
        ];
        let is_below_1 =
            |(key, x)| (key, (0.0..1.0).contains(&x), "expected 0 or more, and less than 1");
        checks.extend(below_1.map(is_below_1));
        match checks.into_iter().find(|(_, holds, _)| !holds) {
            Some((key, _, cause)) => Err(InvalidValue::new(key, cause)),
            None => Ok(()),
        }
    }
}
