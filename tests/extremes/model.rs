//! The models of cases, with optional changes of their weights.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile};
use serde::Deserialize;
use tempfile::TempDir;

use crate::tiny_model;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// A bundled model. If absent, a small model with weights by a rule, both T-Nets and the
    /// classes a, b, c and d.
    bundled: Option<String>,
    #[serde(default)]
    scale: BTreeMap<String, f32>,
    /// The variance of a batch norm that is added after each layer that can have one.
    variance: Option<f32>,
    /// The calibrated largest activation of all layers, for int8.
    activation_range: Option<f32>,
}

pub struct ModelFile {
    pub path: PathBuf,
    _folder: Option<TempDir>,
}

impl Model {
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
        if let Some(variance) = self.variance {
            add_norms(&mut tensors, variance);
        }
        if let Some(range) = self.activation_range {
            let layers = tensors.keys().filter_map(|name| name.strip_suffix(".weight"));
            card.activation_ranges = layers.map(|layer| (layer.to_owned(), range)).collect();
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
    let mut file = WeightsFile::open(path).unwrap();
    let card = ModelCard::from_metadata(path, &file.metadata()).unwrap();
    let names = file.shapes().into_keys();
    (card, names.map(|name| (name.clone(), file.read(&name).unwrap())).collect())
}

/// Adds batch norms that change only the variance of activations. The last vector layer of each
/// stack has no batch norm; the numbers of the others continue from point layers to vector layers.
fn add_norms(tensors: &mut BTreeMap<String, Tensor>, variance: f32) {
    for prefix in ["feat.stn.", "feat.fstn.", "feat.", ""] {
        let layers = |kind: &str| -> Vec<String> {
            let names = (1..).map(|i| format!("{prefix}{kind}{i}.bias"));
            names.take_while(|name| tensors.contains_key(name)).collect()
        };
        let (point_layers, mut vector_layers) = (layers("conv"), layers("fc"));
        vector_layers.pop();
        for (norm, bias) in (1..).zip(point_layers.into_iter().chain(vector_layers)) {
            let width = tensors[&bias].values.len();
            for (part, value) in
                [("weight", 1.0), ("bias", 0.0), ("running_mean", 0.0), ("running_var", variance)]
            {
                let tensor = Tensor { shape: vec![width], values: vec![value; width] };
                tensors.insert(format!("{prefix}bn{norm}.{part}"), tensor);
            }
        }
    }
}
