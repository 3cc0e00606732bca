//! A network in training as a model file of infer-cpu's.

use std::collections::BTreeMap;
use std::path::Path;

use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part, write_half_weights, write_weights};

use crate::error::Error;
use crate::front::LEFT_BEHIND;
use crate::layer::Learns;

/// Parameters and running statistics by name.
#[must_use]
pub fn tensors(network: &mut dyn Learns) -> BTreeMap<String, Tensor> {
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

/// Writes `network` to `path` as it is learnt, atomically.
///
/// # Errors
/// What the system reports.
pub fn write(path: &Path, network: &mut dyn Learns, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = tensors(network);
    tensors.retain(|name, _| !name.starts_with(LEFT_BEHIND));
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

/// Takes `network` to what [`write()`] wrote to `path`; what that left behind is
/// left as it is.
///
/// # Errors
/// A file that is none, or of a network of another shape.
pub fn read(path: &Path, network: &mut dyn Learns) -> Result<(), Error> {
    let mut file = WeightsFile::open(path)?;
    let mut failed = None;
    let mut take = |name: &str, into: &mut Vec<f32>| match file.read(name) {
        Ok(tensor) if tensor.values.len() == into.len() => *into = tensor.values,
        Ok(tensor) => {
            let cause = format!("of shape {:?}, in a network of another", tensor.shape);
            failed = Some(FormatError::malformed(path, tensor_part(name), cause));
        }
        Err(error) => failed = Some(error),
    };
    network.parameters(&mut |parameter| {
        if !parameter.name.starts_with(LEFT_BEHIND) {
            take(&parameter.name, &mut parameter.value);
        }
    });
    network.statistics(&mut |name, values| take(name, values));
    failed.map_or(Ok(()), |error| Err(error.into()))
}

/// Writes `network` to `path` as it is shipped, atomically: batch norms folded,
/// in f16, half the size.
///
/// # Errors
/// A weight that f16 cannot hold; what the system reports.
pub fn ship(path: &Path, network: &dyn Learns, card: &ModelCard) -> Result<(), Error> {
    let mut tensors = BTreeMap::new();
    network.folded(&mut |layer| {
        let bias = Tensor { shape: vec![layer.bias.len()], values: layer.bias };
        let weight = Tensor { shape: layer.shape.to_vec(), values: layer.weight };
        tensors.insert(format!("{}.bias", layer.name), bias);
        tensors.insert(format!("{}.weight", layer.name), weight);
    });
    Ok(write_half_weights(path, &tensors, &card.to_metadata())?)
}
