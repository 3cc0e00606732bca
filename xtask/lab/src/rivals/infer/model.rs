//! The model that all engines run where none is given: random weights of
//! `pointnet_cls`'s shapes, on which alone speed depends.

use anyhow::Result;
use formats::rng::StreamKey;
use formats::weights::{Tensor, write_weights};
use std::collections::BTreeMap;
use std::path::Path;

const SEED: u64 = 3;

const CLASSES: usize = 40;

/// A layer and the batch norm behind it, by their keys.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Of `.weight` and `.bias`.
    pub key: &'static str,
    /// Of the norm; `None` for the last layer of a stack.
    pub norm: Option<&'static str>,
    inputs: usize,
    outputs: usize,
}

const fn layer(
    key: &'static str,
    norm: Option<&'static str>,
    inputs: usize,
    outputs: usize,
) -> Layer {
    Layer { key, norm, inputs, outputs }
}

/// The T-Net that turns points, each layer's input the one before's output.
pub const STN: [Layer; 6] = [
    layer("feat.stn.conv1", Some("feat.stn.bn1"), 3, 64),
    layer("feat.stn.conv2", Some("feat.stn.bn2"), 64, 128),
    layer("feat.stn.conv3", Some("feat.stn.bn3"), 128, 1024),
    layer("feat.stn.fc1", Some("feat.stn.bn4"), 1024, 512),
    layer("feat.stn.fc2", Some("feat.stn.bn5"), 512, 256),
    layer("feat.stn.fc3", None, 256, 9),
];

/// The T-Net that turns features.
pub const FSTN: [Layer; 6] = [
    layer("feat.fstn.conv1", Some("feat.fstn.bn1"), 64, 64),
    layer("feat.fstn.conv2", Some("feat.fstn.bn2"), 64, 128),
    layer("feat.fstn.conv3", Some("feat.fstn.bn3"), 128, 1024),
    layer("feat.fstn.fc1", Some("feat.fstn.bn4"), 1024, 512),
    layer("feat.fstn.fc2", Some("feat.fstn.bn5"), 512, 256),
    layer("feat.fstn.fc3", None, 256, 64 * 64),
];

/// The layers that all points share.
pub const TRUNK: [Layer; 3] = [
    layer("feat.conv1", Some("feat.bn1"), 3, 64),
    layer("feat.conv2", Some("feat.bn2"), 64, 128),
    layer("feat.conv3", Some("feat.bn3"), 128, 1024),
];

/// From global features to logits.
pub const HEAD: [Layer; 3] = [
    layer("fc1", Some("bn1"), 1024, 512),
    layer("fc2", Some("bn2"), 512, 256),
    layer("fc3", None, 256, CLASSES),
];

/// Writes the random model to `file`.
///
/// # Errors
/// If it cannot be written.
pub fn write_random(file: &Path) -> Result<()> {
    let mut tensors = BTreeMap::new();
    for layer in STN.iter().chain(&FSTN).chain(&TRUNK).chain(&HEAD) {
        write_layer(layer, &mut tensors);
    }
    let remark = ("note".to_owned(), "random weights, to measure speed".to_owned());
    Ok(write_weights(file, &tensors, &BTreeMap::from([remark]))?)
}

fn write_layer(layer: &Layer, tensors: &mut BTreeMap<String, Tensor>) {
    let mut add = |key: &str, name: &str, shape: Vec<usize>, range: std::ops::Range<f64>| {
        let name = format!("{key}.{name}");
        let stream = StreamKey::new(SEED, &name, 0);
        let count = shape.iter().product::<usize>() as u64;
        let draw = |n| (range.start + (range.end - range.start) * stream.unit(n)) as f32;
        tensors.insert(name, Tensor { shape, values: (0..count).map(draw).collect() });
    };
    let Layer { key, norm, inputs, outputs } = *layer;
    // He et al. 2015: keeps the variance through ReLUs. A T-Net's last layer is
    // smaller, so that its matrix stays near the identity.
    let turns = key.ends_with("stn.fc3");
    let bound = (6.0 / inputs as f64).sqrt() * if turns { 0.02 } else { 1.0 };
    let shape = if key.contains("conv") { vec![outputs, inputs, 1] } else { vec![outputs, inputs] };
    add(key, "weight", shape, -bound..bound);
    add(key, "bias", vec![outputs], -0.1..0.1);
    if let Some(norm) = norm {
        add(norm, "weight", vec![outputs], 0.8..1.2);
        add(norm, "bias", vec![outputs], -0.1..0.1);
        add(norm, "running_mean", vec![outputs], -0.1..0.1);
        add(norm, "running_var", vec![outputs], 0.5..1.5);
    }
}
