//! Models that a case names, perhaps with other weights than they have.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile};
use serde::Deserialize;
use tempfile::TempDir;

use crate::tiny_model;

/// A model, and what is changed in it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// A bundled model; without a name, a small one of weights by rule, with both
    /// T-Nets and the classes a, b, c, d.
    bundled: Option<String>,
    /// Tensors, by their names, to be multiplied by a factor.
    #[serde(default)]
    scale: BTreeMap<String, f32>,
    /// Batch norms of this variance behind every layer that may have one.
    variance: Option<f32>,
    /// What int8 is told of every layer's largest activation.
    activation_range: Option<f32>,
}

/// A model's file, there as long as this is.
pub struct ModelFile {
    /// Where it is.
    pub path: PathBuf,
    _folder: Option<TempDir>,
}

impl Model {
    /// The file of the model, changed as asked.
    pub fn file(&self) -> ModelFile {
        let bundled = self.bundled.as_ref().map(|name| {
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../assets/weights")
                .join(format!("{name}.safetensors"))
        });
        let changed =
            !self.scale.is_empty() || self.variance.is_some() || self.activation_range.is_some();
        if let (Some(path), false) = (&bundled, changed) {
            return ModelFile { path: path.clone(), _folder: None };
        }
        let (mut card, mut tensors) = bundled.map_or_else(small, |path| whole(&path));
        for (name, factor) in &self.scale {
            let tensor = tensors.get_mut(name).unwrap_or_else(|| panic!("`scale`: no {name}"));
            tensor.values.iter_mut().for_each(|value| *value *= factor);
        }
        self.variance.iter().for_each(|&variance| add_norms(&mut tensors, variance));
        if let Some(range) = self.activation_range {
            card.activation_ranges = layers(&tensors).map(|layer| (layer, range)).collect();
        }
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let path = folder.path().join("m.safetensors");
        ModelFile { path: tiny_model::write(&path, &tensors, &card), _folder: Some(folder) }
    }
}

fn small() -> (ModelCard, BTreeMap<String, Tensor>) {
    let classes = ["a", "b", "c", "d"].map(str::to_owned).to_vec();
    (ModelCard { classes, ..ModelCard::default() }, tiny_model::tensors(4))
}

fn whole(path: &Path) -> (ModelCard, BTreeMap<String, Tensor>) {
    let mut file = WeightsFile::open(path).unwrap_or_else(|error| panic!("{error}"));
    let card = ModelCard::from_metadata(path, &file.metadata());
    let names: Vec<String> = file.shapes().into_keys().collect();
    let mut read = |name: String| {
        let tensor = file.read(&name).unwrap_or_else(|error| panic!("{error}"));
        (name, tensor)
    };
    let tensors = names.into_iter().map(&mut read).collect();
    (card.unwrap_or_else(|error| panic!("{error}")), tensors)
}

/// The names of the layers that have weights.
fn layers(tensors: &BTreeMap<String, Tensor>) -> impl Iterator<Item = String> {
    tensors.keys().filter_map(|name| name.strip_suffix(".weight").map(str::to_owned))
}

/// Norms that leave activations alone but for their variance: each stack's last
/// vector layer has none, the others count through point and vector layers.
fn add_norms(tensors: &mut BTreeMap<String, Tensor>, variance: f32) {
    let all: Vec<String> = layers(tensors).collect();
    for layer in &all {
        let Some((prefix, kind, number)) = parts(layer) else { continue };
        let last = |kind: &str| {
            let count =
                |name: &&String| parts(name).is_some_and(|(p, k, _)| p == prefix && k == kind);
            all.iter().filter(count).count()
        };
        if kind == "fc" && number == last("fc") {
            continue;
        }
        let norm = if kind == "fc" { last("conv") + number } else { number };
        let width = tensors[&format!("{layer}.bias")].values.len();
        for (part, value) in
            [("weight", 1.0), ("bias", 0.0), ("running_mean", 0.0), ("running_var", variance)]
        {
            let tensor = Tensor { shape: vec![width], values: vec![value; width] };
            tensors.insert(format!("{prefix}bn{norm}.{part}"), tensor);
        }
    }
}

/// `feat.stn.conv2` as `feat.stn.`, `conv`, 2.
fn parts(layer: &str) -> Option<(&str, &str, usize)> {
    let stem = layer.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let (prefix, kind) = stem.split_at(stem.rfind('.').map_or(0, |dot| dot + 1));
    Some((prefix, kind, layer[stem.len()..].parse().ok()?))
}
