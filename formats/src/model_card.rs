//! The card of a model: what it states about itself in safetensors' metadata.
//!
//! | key | value | if absent |
//! | --- | --- | --- |
//! | `classes` | JSON list of names, in the order of the logits | `class 0`, `class 1`, … |
//! | `normalization` | `unit-sphere`, `metric` or `none` | `unit-sphere` |
//! | `sampler` | sampler in training, as `infer-cpu --sampler` names it | `all` |
//! | `points` | points that the sampler keeps | none |
//! | `fps_start` | `farthest` or `first` | `farthest` |
//! | `transform_after` | number of layers of the trunk before the feature transform | `1` |
//! | `pooled` | `relu` if the trunk's last layer has a ReLU, else `linear` | `linear` |
//! | `edge_radii` | JSON list: the radius of the neighbourhoods of each layer `edge.conv1…` | none |
//! | `abstractions` | JSON list: the number of centres and the radius of each set abstraction `sa1…` | none |
//! | `activation_ranges` | JSON object: layer to its largest activation, for int8 | calibrated at load |
//! | `unknown_classes` | JSON list of the classes that are answered as `unknown` | none |
//! | `asked` | of a bird's-eye network: the model that is asked about what it sees | none |
//! | `confidence` | of a bird's-eye network: JSON object, class to the weights of its confidence: of boxes, and of clusters | none |
//! | `temperature` | divisor of the logits before the softmax | `1` |
//! | `trained` | `false` for a model of random weights | `true` |
//! | `training_set`, `accuracy`, `provenance` | free text | |
//! | `widths` | for people only; the tensors decide | |

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde_json::json;

use crate::error::FormatError;
use crate::weights::WeightsFile;

/// The card of a model. See the module for the keys.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCard {
    /// Class names in the order of the logits; empty if the file has no names.
    pub classes: Vec<String>,
    /// How clouds were normalised in training.
    pub normalization: Normalization,
    /// The sampler in training.
    pub sampler: Option<String>,
    /// The number of points that the sampler keeps.
    pub points: Option<usize>,
    /// The first point of farthest point sampling in training.
    pub fps_start: Option<String>,
    /// The number of layers of the trunk before the feature transform.
    pub transform_after: usize,
    /// Whether the trunk's last layer has a ReLU.
    pub pooled_relu: bool,
    /// The radius of the neighbourhoods of each EdgeConv layer, in units of the normalised cloud.
    pub edge_radii: Vec<f32>,
    /// The number of centres of each set abstraction, and the radius of their neighbourhoods.
    pub abstractions: Vec<(usize, f32)>,
    /// The largest activation of each layer, by the layer's name.
    pub activation_ranges: BTreeMap<String, f32>,
    /// The classes that are not objects of interest, such as trees or walls, and are answered as
    /// `unknown`.
    pub unknown_classes: Vec<String>,
    /// The model of clusters that is asked about what a bird's-eye network sees.
    pub asked: Option<String>,
    /// The confidence in an object of each class, before the logistic function: a bias, and the weights of
    /// the logit of a bird's-eye network and of that of the model that is asked. The first are those of boxes that
    /// the network sees, and the second, if there are any, those of clusters.
    pub confidence: BTreeMap<String, Vec<[f64; 3]>>,
    /// The divisor of the logits before the softmax.
    pub temperature: f64,
    /// Whether the weights were trained.
    pub trained: bool,
    /// The training set.
    pub training_set: Option<String>,
    /// The accuracy and the test set.
    pub accuracy: Option<String>,
    /// The source of the weights.
    pub provenance: Option<String>,
}

crate::named! {
    /// The normalisation of a cloud before it enters a network.
    #[derive(Default, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Normalization: "normalization" {
        /// Mean to 0, largest radius to 1.
        #[default]
        UnitSphere = "unit-sphere",
        /// Mean of x and of y to 0, and the ground, or the lowest z if it is unknown, to 0; in
        /// metres, without scaling.
        Metric = "metric",
        /// As [`Normalization::Metric`], turned about z so that the line of sight from the sensor
        /// to the mean is along x. The network can tell the side of an object that faced the sensor.
        MetricSight = "metric-sight",
        /// No normalisation.
        None = "none",
    }
}

impl Normalization {
    /// Whether clouds keep their size in metres.
    #[must_use]
    pub fn is_metric(self) -> bool {
        matches!(self, Self::Metric | Self::MetricSight)
    }
}

impl Default for ModelCard {
    /// The card of the baseline's checkpoints, which have no metadata.
    fn default() -> Self {
        Self {
            classes: Vec::new(),
            normalization: Normalization::default(),
            sampler: None,
            points: None,
            fps_start: None,
            transform_after: 1,
            pooled_relu: false,
            edge_radii: Vec::new(),
            abstractions: Vec::new(),
            activation_ranges: BTreeMap::new(),
            unknown_classes: Vec::new(),
            asked: None,
            confidence: BTreeMap::new(),
            temperature: 1.0,
            trained: true,
            training_set: None,
            accuracy: None,
            provenance: None,
        }
    }
}

impl ModelCard {
    /// Reads the card of the model file at `path`, without its weights.
    ///
    /// # Errors
    /// A file that is not safetensors; as [`ModelCard::from_metadata`].
    pub fn read(path: &Path) -> Result<Self, FormatError> {
        Self::from_metadata(path, &WeightsFile::open(path)?.metadata())
    }

    /// Parses `metadata` of the model file at `path`. Other keys are ignored.
    ///
    /// # Errors
    /// An invalid value: [`FormatError::Malformed`] with the key.
    pub fn from_metadata(
        path: &Path,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Self, FormatError> {
        let text = |key: &str| metadata.get(key).cloned();
        let entries = Entries { path, metadata };
        let default = Self::default();
        let either = |no, yes| move |word: &str| choice(word, no, yes);
        let classes = entries.get("classes", json, default.classes)?;
        let unknown_classes =
            entries.get("unknown_classes", |list| some_of(&classes, list), Vec::new())?;
        Ok(Self {
            classes,
            normalization: entries.get("normalization", str::parse, default.normalization)?,
            sampler: text("sampler"),
            points: entries.get("points", |word| count(word).map(Some), None)?,
            fps_start: text("fps_start"),
            transform_after: entries.get("transform_after", count, default.transform_after)?,
            pooled_relu: entries.get("pooled", either("linear", "relu"), default.pooled_relu)?,
            edge_radii: entries.get("edge_radii", json, default.edge_radii)?,
            abstractions: entries.get("abstractions", json, default.abstractions)?,
            activation_ranges: entries.get("activation_ranges", json, BTreeMap::new())?,
            unknown_classes,
            asked: text("asked"),
            confidence: entries.get("confidence", json, BTreeMap::new())?,
            temperature: entries.get("temperature", positive, default.temperature)?,
            trained: entries.get("trained", either("false", "true"), default.trained)?,
            training_set: text("training_set"),
            accuracy: text("accuracy"),
            provenance: text("provenance"),
        })
    }

    /// The card as metadata, without unknown values.
    #[must_use]
    pub fn to_metadata(&self) -> BTreeMap<String, String> {
        let ranges = self.activation_ranges.iter();
        let ranges: BTreeMap<_, _> = ranges.map(|(layer, &r)| (layer, f64::from(r))).collect();
        let pair = |(n, radius): &(usize, f32)| format!("[{n}, {radius:?}]");
        let abstractions = self.abstractions.iter().map(pair).collect::<Vec<_>>().join(", ");
        let entries = [
            ("classes", (!self.classes.is_empty()).then(|| json!(self.classes).to_string())),
            ("normalization", Some(self.normalization.name().to_owned())),
            ("sampler", self.sampler.clone()),
            ("points", self.points.map(|points| points.to_string())),
            ("fps_start", self.fps_start.clone()),
            ("transform_after", Some(self.transform_after.to_string())),
            ("pooled", Some(if self.pooled_relu { "relu" } else { "linear" }.to_owned())),
            ("edge_radii", (!self.edge_radii.is_empty()).then(|| format!("{:?}", self.edge_radii))),
            ("abstractions", (!abstractions.is_empty()).then(|| format!("[{abstractions}]"))),
            ("activation_ranges", (!ranges.is_empty()).then(|| json!(ranges).to_string())),
            (
                "unknown_classes",
                (!self.unknown_classes.is_empty()).then(|| json!(self.unknown_classes).to_string()),
            ),
            ("asked", self.asked.clone()),
            (
                "confidence",
                (!self.confidence.is_empty()).then(|| json!(self.confidence).to_string()),
            ),
            ("temperature", (self.temperature != 1.0).then(|| self.temperature.to_string())),
            ("trained", Some(self.trained.to_string())),
            ("training_set", self.training_set.clone()),
            ("accuracy", self.accuracy.clone()),
            ("provenance", self.provenance.clone()),
        ];
        let known = entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        known.collect()
    }
}

struct Entries<'a> {
    path: &'a Path,
    metadata: &'a BTreeMap<String, String>,
}

impl Entries<'_> {
    fn get<T, E: Display>(
        &self,
        key: &str,
        parse: impl FnOnce(&str) -> Result<T, E>,
        if_absent: T,
    ) -> Result<T, FormatError> {
        let Some(value) = self.metadata.get(key) else { return Ok(if_absent) };
        let part = || format!("metadata `{key}`");
        parse(value).map_err(|cause| FormatError::malformed(self.path, part(), cause))
    }
}

fn json<T: DeserializeOwned>(value: &str) -> Result<T, serde_json::Error> {
    serde_json::from_str(value)
}

fn count(value: &str) -> Result<usize, String> {
    value.parse().map_err(|_| format!("expected a count, found `{value}`"))
}

fn finite(value: &str) -> Result<f64, String> {
    let number = value.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| format!("expected a finite number, found `{value}`"))
}

fn positive(value: &str) -> Result<f64, String> {
    let number = finite(value).ok().filter(|&number| number > 0.0);
    number.ok_or_else(|| format!("expected a finite number above 0, found `{value}`"))
}

/// The names in the JSON list `value`, each of which must be one of `classes`.
fn some_of(classes: &[String], value: &str) -> Result<Vec<String>, String> {
    let names: Vec<String> = json(value).map_err(|cause| cause.to_string())?;
    match names.iter().find(|name| !classes.contains(name)) {
        Some(name) => Err(format!("expected some of the classes, found `{name}`")),
        None => Ok(names),
    }
}

fn choice(value: &str, no: &str, yes: &str) -> Result<bool, String> {
    match value {
        _ if value == yes => Ok(true),
        _ if value == no => Ok(false),
        _ => Err(format!("expected `{yes}` or `{no}`, found `{value}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_comes_back_from_its_metadata() {
        let card = ModelCard {
            classes: vec!["cup".into(), "the \"big\" one".into()],
            normalization: Normalization::None,
            sampler: Some("cpl".into()),
            points: Some(64),
            fps_start: Some("first".into()),
            transform_after: 2,
            pooled_relu: true,
            edge_radii: vec![0.1, 0.4],
            abstractions: vec![(256, 0.2), (64, 0.4)],
            activation_ranges: BTreeMap::from([("feat.conv1".into(), 1.1)]),
            unknown_classes: vec!["cup".into()],
            asked: Some("cups".into()),
            confidence: BTreeMap::from([("cup".into(), vec![[0.5, 1.0, -2.0], [0.0; 3]])]),
            temperature: 1.5,
            trained: false,
            training_set: Some("t".into()),
            accuracy: Some("0.9".into()),
            provenance: Some("p".into()),
        };
        let back = ModelCard::from_metadata(Path::new("m"), &card.to_metadata());
        assert_eq!(back.unwrap(), card);
        let empty = ModelCard::from_metadata(Path::new("m"), &BTreeMap::new());
        assert_eq!(empty.unwrap(), ModelCard::default());
    }

    #[test]
    fn an_invalid_value_is_an_error_that_names_the_key() {
        let keys = [
            "classes",
            "normalization",
            "points",
            "transform_after",
            "pooled",
            "edge_radii",
            "abstractions",
            "unknown_classes",
            "temperature",
            "trained",
        ];
        for key in keys {
            let metadata = BTreeMap::from([(key.to_owned(), "-1".to_owned())]);
            let error = ModelCard::from_metadata(Path::new("m"), &metadata).unwrap_err();
            assert!(error.to_string().contains(&format!("`{key}`")), "{error}");
        }
        let metadata = [("classes", r#"["cup"]"#), ("unknown_classes", r#"["tree"]"#)];
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let error = ModelCard::from_metadata(Path::new("m"), &metadata.into()).unwrap_err();
        let expected = "m: metadata `unknown_classes`: expected some of the classes, found `tree`";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn defaults_of_unknown_objects_are_left_out_of_the_metadata() {
        let metadata = ModelCard::default().to_metadata();
        let keys = ["unknown_classes", "temperature"];
        assert!(keys.iter().all(|&key| !metadata.contains_key(key)), "{metadata:?}");
    }
}
