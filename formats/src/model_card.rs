//! What a model file says about itself, in safetensors' metadata.
//!
//! | key | value | if absent |
//! | --- | --- | --- |
//! | `classes` | JSON list of names, in the order of the logits | `class 0`, `class 1`, … |
//! | `normalization` | `unit-sphere` or `none` | `unit-sphere` |
//! | `sampler` | sampler that the model was trained behind, as `infer-cpu --sampler` names it | `all` |
//! | `points` | points that the sampler keeps | none |
//! | `fps_start` | `farthest` or `first` | `farthest` |
//! | `transform_after` | layer of the trunk whose features the feature transform turns | `1` |
//! | `pooled` | `relu` if the trunk's last layer has a ReLU, else `linear` | `linear` |
//! | `edge_radii` | JSON list: how far each layer `edge.conv1…` looks around a point | none |
//! | `activation_ranges` | JSON object: layer to its largest activation, for int8 | calibrated at load |
//! | `trained` | `false` for a model of random weights | `true` |
//! | `training_set`, `accuracy`, `provenance` | free text | |
//! | `widths` | for the reader; the tensors decide | |

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::FormatError;
use crate::weights::WeightsFile;

/// A model's remarks about itself. See the module for the keys.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCard {
    /// Class names in the order of the logits; empty if the file names none.
    pub classes: Vec<String>,
    /// How clouds were normalised in training.
    pub normalization: Normalization,
    /// The sampler that the model was trained behind.
    pub sampler: Option<String>,
    /// How many points that sampler keeps.
    pub points: Option<usize>,
    /// Where farthest point sampling began in training.
    pub fps_start: Option<String>,
    /// How many layers of the trunk come before the feature transform.
    pub transform_after: usize,
    /// Whether the trunk's last layer has a ReLU.
    pub pooled_relu: bool,
    /// How far each layer of surroundings looks, in the normalised cloud's unit.
    pub edge_radii: Vec<f32>,
    /// The largest activation of each layer, by the layer's name.
    pub activation_ranges: BTreeMap<String, f32>,
    /// Whether the weights were trained at all.
    pub trained: bool,
    /// What it was trained on.
    pub training_set: Option<String>,
    /// What it reached, and on what.
    pub accuracy: Option<String>,
    /// Where the weights come from.
    pub provenance: Option<String>,
}

/// How a cloud is moved and scaled before a network sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normalization {
    /// Mean to 0, largest radius to 1.
    #[default]
    UnitSphere,
    /// As it comes.
    None,
}

impl Normalization {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::UnitSphere, Self::None];

    /// Its name on command lines and in model files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnitSphere => "unit-sphere",
            Self::None => "none",
        }
    }
}

impl std::str::FromStr for Normalization {
    type Err = FormatError;

    fn from_str(word: &str) -> Result<Self, FormatError> {
        Self::ALL.into_iter().find(|one| one.name() == word).ok_or_else(|| {
            FormatError::UnknownName {
                word: word.to_owned(),
                what: "normalization",
                choices: Self::ALL.map(Self::name).join(", "),
            }
        })
    }
}

impl Default for ModelCard {
    /// What the baseline's own checkpoints mean, which say nothing.
    fn default() -> Self {
        Self {
            classes: Vec::new(),
            normalization: Normalization::UnitSphere,
            sampler: None,
            points: None,
            fps_start: None,
            transform_after: 1,
            pooled_relu: false,
            edge_radii: Vec::new(),
            activation_ranges: BTreeMap::new(),
            trained: true,
            training_set: None,
            accuracy: None,
            provenance: None,
        }
    }
}

impl ModelCard {
    /// Reads the card of the model file at `path`, and none of its weights.
    ///
    /// # Errors
    /// A file that is no safetensors; as [`ModelCard::from_metadata`].
    pub fn read(path: &Path) -> Result<Self, FormatError> {
        Self::from_metadata(path, &WeightsFile::open(path)?.metadata())
    }

    /// Interprets `metadata` of the model file at `path`. Keys of other names
    /// are passed over.
    ///
    /// # Errors
    /// A value that makes no sense: [`FormatError::Malformed`] with the key.
    pub fn from_metadata(
        path: &Path,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Self, FormatError> {
        let bad = |key: &str, cause: String| {
            FormatError::malformed(path, format!("metadata `{key}`"), cause)
        };
        let text = |key: &str| metadata.get(key).cloned();
        let number = |key: &str| {
            let parse = |value: String| {
                value
                    .parse::<usize>()
                    .map_err(|_| bad(key, format!("expected a count, found `{value}`")))
            };
            text(key).map(parse).transpose()
        };
        let choice = |key: &str, yes: &str, no: &str| match metadata.get(key) {
            None => Ok(None),
            Some(value) if value == yes => Ok(Some(true)),
            Some(value) if value == no => Ok(Some(false)),
            Some(value) => Err(bad(key, format!("expected `{yes}` or `{no}`, found `{value}`"))),
        };
        let default = Self::default();
        let classes = text("classes").map(|value| serde_json::from_str(&value)).transpose();
        let ranges = text("activation_ranges").map(|value| serde_json::from_str(&value));
        let radii = text("edge_radii").map(|value| serde_json::from_str(&value)).transpose();
        let normalization = text("normalization").map(|value| value.parse()).transpose();
        Ok(Self {
            classes: classes.map_err(|e| bad("classes", e.to_string()))?.unwrap_or_default(),
            normalization: normalization
                .map_err(|e: FormatError| bad("normalization", e.to_string()))?
                .unwrap_or_default(),
            sampler: text("sampler"),
            points: number("points")?,
            fps_start: text("fps_start"),
            transform_after: number("transform_after")?.unwrap_or(default.transform_after),
            pooled_relu: choice("pooled", "relu", "linear")?.unwrap_or(default.pooled_relu),
            edge_radii: radii.map_err(|e| bad("edge_radii", e.to_string()))?.unwrap_or_default(),
            activation_ranges: ranges
                .transpose()
                .map_err(|e| bad("activation_ranges", e.to_string()))?
                .unwrap_or_default(),
            trained: choice("trained", "true", "false")?.unwrap_or(default.trained),
            training_set: text("training_set"),
            accuracy: text("accuracy"),
            provenance: text("provenance"),
        })
    }

    /// The card as metadata; what is unknown is left out.
    #[must_use]
    pub fn to_metadata(&self) -> BTreeMap<String, String> {
        let json = |names: &[String]| serde_json::Value::from(names.to_vec()).to_string();
        let ranges: serde_json::Map<_, _> = self
            .activation_ranges
            .iter()
            .map(|(layer, &range)| (layer.clone(), f64::from(range).into()))
            .collect();
        let entries = [
            ("classes", (!self.classes.is_empty()).then(|| json(&self.classes))),
            ("normalization", Some(self.normalization.name().to_owned())),
            ("sampler", self.sampler.clone()),
            ("points", self.points.map(|points| points.to_string())),
            ("fps_start", self.fps_start.clone()),
            ("transform_after", Some(self.transform_after.to_string())),
            ("pooled", Some(if self.pooled_relu { "relu" } else { "linear" }.to_owned())),
            ("edge_radii", (!self.edge_radii.is_empty()).then(|| format!("{:?}", self.edge_radii))),
            (
                "activation_ranges",
                (!ranges.is_empty()).then(|| serde_json::Value::from(ranges).to_string()),
            ),
            ("trained", Some(self.trained.to_string())),
            ("training_set", self.training_set.clone()),
            ("accuracy", self.accuracy.clone()),
            ("provenance", self.provenance.clone()),
        ];
        let known = entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        known.collect()
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
            activation_ranges: BTreeMap::from([("feat.conv1".into(), 1.1)]),
            trained: false,
            training_set: Some("t".into()),
            accuracy: Some("0.9".into()),
            provenance: Some("p".into()),
        };
        let back = ModelCard::from_metadata(Path::new("m"), &card.to_metadata());
        assert_eq!(back.unwrap(), card);
        let silent = ModelCard::from_metadata(Path::new("m"), &BTreeMap::new());
        assert_eq!(silent.unwrap(), ModelCard::default());
    }

    #[test]
    fn a_value_that_makes_no_sense_is_an_error_that_names_the_key() {
        let keys = [
            "classes",
            "normalization",
            "points",
            "transform_after",
            "pooled",
            "edge_radii",
            "trained",
        ];
        for key in keys {
            let metadata = BTreeMap::from([(key.to_owned(), "-1".to_owned())]);
            let error = ModelCard::from_metadata(Path::new("m"), &metadata).unwrap_err();
            assert!(error.to_string().contains(&format!("`{key}`")), "{error}");
        }
    }
}
