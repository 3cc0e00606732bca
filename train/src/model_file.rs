//! Model files for infer-cpu, of networks in training.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part, write_half_weights, write_weights};

use crate::error::Error;
use crate::layer::Module;
use crate::point_encoder::TRAINING_ONLY;

/// Parameters and running statistics by name.
#[must_use]
pub fn tensors(network: &mut dyn Module) -> BTreeMap<String, Tensor> {
    let mut tensors = BTreeMap::new();
    network.parameters(&mut |parameter| {
        let tensor = Tensor { shape: parameter.shape.clone(), values: parameter.value.clone() };
        tensors.insert(parameter.name.clone(), tensor);
    });
    network.statistics(&mut |name, values| {
        let tensor = Tensor { shape: vec![values.len()], values: values.clone() };
        tensors.insert(name.to_owned(), tensor);
    });
    tensors
}

/// Writes the weights of `network` to `path` as they are trained, atomically.
///
/// # Errors
/// What the system reports.
pub fn write(path: &Path, network: &mut dyn Module, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = tensors(network);
    tensors.retain(|name, _| !name.starts_with(TRAINING_ONLY));
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

/// Sets `network` to the weights that [`write()`] wrote to `path`. Parameters
/// that the file leaves out keep their values.
///
/// # Errors
/// A file that is not a model, or a model of another shape.
pub fn read(path: &Path, network: &mut dyn Module) -> Result<(), Error> {
    let mut file = WeightsFile::open(path)?;
    let mut failed = None;
    let mut take = |name: &str, into: &mut Vec<f32>| match file.read(name) {
        Ok(tensor) if tensor.values.len() == into.len() => *into = tensor.values,
        Ok(tensor) => {
            let cause = format!("expected {} values, found shape {:?}", into.len(), tensor.shape);
            failed = Some(FormatError::malformed(path, tensor_part(name), cause));
        }
        Err(error) => failed = Some(error),
    };
    network.parameters(&mut |parameter| {
        if !parameter.name.starts_with(TRAINING_ONLY) {
            take(&parameter.name, &mut parameter.value);
        }
    });
    network.statistics(&mut |name, values| take(name, values));
    failed.map_or(Ok(()), |error| Err(error.into()))
}

/// Writes `network` to `path` for release, atomically: in f16, with the batch
/// norms folded into the linear layers.
///
/// # Errors
/// A weight that f16 cannot hold; what the system reports.
pub fn ship(path: &Path, network: &dyn Module, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = BTreeMap::new();
    network.folded(&mut |layer| {
        let bias = Tensor { shape: vec![layer.bias.len()], values: layer.bias };
        let weight = Tensor { shape: layer.shape.to_vec(), values: layer.weight };
        tensors.insert(format!("{}.bias", layer.name), bias);
        tensors.insert(format!("{}.weight", layer.name), weight);
    });
    Ok(write_half_weights(path, &tensors, &card.to_metadata())?)
}
