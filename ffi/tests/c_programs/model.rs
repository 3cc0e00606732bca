//! A model small enough to reason about.

use std::collections::BTreeMap;
use std::path::Path;

use formats::model_card::{ModelCard, Normalization};
use formats::weights::{Tensor, write_weights};

/// Writes a model of the classes x, y and z: a cloud in the positive octant is of the axis along which
/// it reaches farthest.
pub fn write_longest_axis_model(path: &Path) {
    write_longest_axis_model_of(["x", "y", "z"], Normalization::None, path);
}

/// As [`write_longest_axis_model`], with other names of the classes and of other clouds. A trunk that passes coordinates
/// on, the maximum over points, a head that passes them on.
pub fn write_longest_axis_model_of(classes: [&str; 3], normalization: Normalization, path: &Path) {
    let identity = Tensor { shape: vec![3, 3], values: vec![1., 0., 0., 0., 1., 0., 0., 0., 1.] };
    let zeros = Tensor { shape: vec![3], values: vec![0.0; 3] };
    let layers = ["feat.conv1", "feat.conv2", "fc1"].into_iter().flat_map(|layer| {
        let weight = (format!("{layer}.weight"), identity.clone());
        [weight, (format!("{layer}.bias"), zeros.clone())]
    });
    let card = ModelCard {
        classes: classes.map(str::to_owned).to_vec(),
        normalization,
        ..ModelCard::default()
    };
    let tensors: BTreeMap<_, _> = layers.collect();
    write_weights(path, &tensors, &card.to_metadata()).unwrap();
}
