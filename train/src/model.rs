//! A network in training as a model file of infer-cpu's.

use std::collections::BTreeMap;
use std::path::Path;

use formats::model_card::ModelCard;
use formats::weights::{Tensor, write_weights};

use crate::error::Error;
use crate::layer::Learns;
use crate::network::PointNet;

/// Parameters and running statistics by name.
#[must_use]
pub fn tensors(network: &mut PointNet) -> BTreeMap<String, Tensor> {
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

/// Writes `network` to `path`, atomically.
///
/// # Errors
/// What the system reports.
pub fn write(path: &Path, network: &mut PointNet, card: &ModelCard) -> Result<(), Error> {
    Ok(write_weights(path, &tensors(network), &card.to_metadata())?)
}
