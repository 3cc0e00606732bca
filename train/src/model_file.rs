//! Writes networks in training to model files for infer-cpu, and reads them.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part, write_half_weights, write_weights};

use crate::error::Error;
use crate::layer::Module;
use crate::point_encoder::TRAINING_ONLY;

/// The parameters and running statistics of `network` by name.
#[must_use]
pub fn tensors(network: &mut dyn Module) -> BTreeMap<String, Tensor> {
    let mut tensors = BTreeMap::new();
    for parameter in network.parameters() {
        let tensor = Tensor { shape: parameter.shape.clone(), values: parameter.value.clone() };
        tensors.insert(parameter.name.clone(), tensor);
    }
    for (name, values) in network.statistics() {
        tensors.insert(name, Tensor { shape: vec![values.len()], values: values.clone() });
    }
    tensors
}

/// Writes the weights and batch norms of `network` to `path` in f32, atomically.
pub fn write(path: &Path, network: &mut dyn Module, card: &ModelCard) -> Result<(), Error> {
    write_tensors(path, tensors(network), card)
}

/// Does the same for the `tensors` of a network.
pub fn write_tensors(
    path: &Path,
    mut tensors: BTreeMap<String, Tensor>,
    card: &ModelCard,
) -> Result<(), Error> {
    tensors.retain(|name, _| !name.starts_with(TRAINING_ONLY));
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

/// Sets `network` to the weights that [`write()`] wrote to `path`. Parameters that serve only
/// training keep their values.
pub fn read(path: &Path, network: &mut dyn Module) -> Result<(), Error> {
    let mut file = WeightsFile::open(path)?;
    for parameter in network.parameters() {
        if !parameter.name.starts_with(TRAINING_ONLY) {
            read_into(&mut file, &parameter.name, &mut parameter.value)?;
        }
    }
    let mut statistics = network.statistics().into_iter();
    Ok(statistics.try_for_each(|(name, values)| read_into(&mut file, &name, values))?)
}

/// Sets `values` to the tensor `name` of `file`.
pub fn read_into(
    file: &mut WeightsFile,
    name: &str,
    values: &mut Vec<f32>,
) -> Result<(), FormatError> {
    let tensor = file.read(name)?;
    if tensor.values.len() != values.len() {
        let cause = format!("expected {} values, found shape {:?}", values.len(), tensor.shape);
        return Err(FormatError::malformed(file.path(), tensor_part(name), cause));
    }
    *values = tensor.values;
    Ok(())
}

/// Writes `network` for release: in f16, with the batch norms folded in, atomically.
pub fn ship(path: &Path, network: &mut dyn Module, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = BTreeMap::new();
    for layer in network.folded() {
        let bias = Tensor { shape: vec![layer.bias.len()], values: layer.bias };
        let weight = Tensor { shape: layer.shape.to_vec(), values: layer.weight };
        tensors.insert(format!("{}.bias", layer.name), bias);
        tensors.insert(format!("{}.weight", layer.name), weight);
    }
    tensors.retain(|name, _| !name.starts_with(TRAINING_ONLY));
    Ok(write_half_weights(path, &tensors, &card.to_metadata())?)
}
