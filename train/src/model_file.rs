//! Writes networks in training to model files for infer-cpu, and reads them.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part, write_half_weights, write_weights};

use crate::error::Error;
use crate::layer::{LayerMut, Module};
use crate::parameter::Parameter;
use crate::point_encoder::TRAINING_ONLY;

/// The parameters and running statistics of `network` by name.
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
    let mut tensors = tensors(network);
    tensors.retain(|name, _| !name.starts_with(TRAINING_ONLY));
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

/// Sets `network` to the weights that [`write()`] wrote to `path`. Parameters that serve only
/// training keep their values.
pub fn read(path: &Path, network: &mut dyn Module) -> Result<(), Error> {
    let mut file = WeightsFile::open(path)?;
    for Parameter { name, shape, value, .. } in network.parameters() {
        if !name.starts_with(TRAINING_ONLY) {
            read_into(&mut file, name, shape, value)?;
        }
    }
    read_statistics(&mut file, network)
}

/// Sets the running statistics of `network` to those in `file`.
pub fn read_statistics(file: &mut WeightsFile, network: &mut dyn Module) -> Result<(), Error> {
    for (name, values) in network.statistics() {
        read_into(file, &name, &[values.len()], values)?;
    }
    Ok(())
}

/// Sets `values` to the tensor `name` of `file`, which must have this `shape`.
pub fn read_into(
    file: &mut WeightsFile,
    name: &str,
    shape: &[usize],
    values: &mut Vec<f32>,
) -> Result<(), FormatError> {
    let found = file.shape(name);
    // PyTorch's one-dimensional convolutions have a third axis, of one element.
    if found.is_none_or(|found| found != shape && found.strip_suffix(&[1]) != Some(shape)) {
        let found = found.map_or("none".to_owned(), |found| format!("{found:?}"));
        let cause = format!("expected shape {shape:?}, as the recipe has it, found {found}");
        return Err(FormatError::malformed(file.path(), tensor_part(name), cause));
    }
    *values = file.read(name)?.values;
    Ok(())
}

/// Writes `network` for release: in f16, with the batch norms folded in, atomically.
pub fn ship(path: &Path, network: &mut dyn Module, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = BTreeMap::new();
    for LayerMut { linear, norm, .. } in network.layers() {
        let (weights, biases) = match norm {
            Some(norm) => norm.folded_into(linear),
            None => (linear.weight.value.clone(), linear.bias.value.clone()),
        };
        for (parameter, values) in [(&linear.weight, weights), (&linear.bias, biases)] {
            let tensor = Tensor { shape: parameter.shape.clone(), values };
            tensors.insert(parameter.name.clone(), tensor);
        }
    }
    tensors.retain(|name, _| !name.starts_with(TRAINING_ONLY));
    Ok(write_half_weights(path, &tensors, &card.to_metadata())?)
}
