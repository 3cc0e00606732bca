//! The layers of a model file, and a stand-in for a trained model: the baseline network
//! with random weights.

use crate::measure::baseline::{PARTS, WIDTHS};
use anyhow::{Context, ensure};
use formats::model_card::{ModelCard, Normalization};
use formats::rng::StreamKey;
use formats::weights::{Tensor, WeightsFile, write_weights};
use std::collections::BTreeMap;
use std::path::Path;

/// Inputs and outputs of one linear layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Inputs.
    pub inputs: usize,
    /// Outputs.
    pub outputs: usize,
}

/// Layers before and after a pooling.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Net {
    /// Point-wise layers.
    pub convs: Vec<Layer>,
    /// Vector layers.
    pub fcs: Vec<Layer>,
}

/// The layers of a PointNet; a part that it lacks has none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// The T-Net of the coordinates.
    pub stn: Net,
    /// The T-Net of the features.
    pub fstn: Net,
    /// Trunk and head.
    pub trunk: Net,
    /// Layers of the trunk before the feature transform.
    pub transform_after: usize,
    /// The front end of a Critical Points Layer.
    pub front: Net,
}

impl Network {
    /// The layers of the model at `path`.
    ///
    /// # Errors
    /// A file that is not a model.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let file = WeightsFile::open(path)?;
        let card = ModelCard::from_metadata(path, &file.metadata())?;
        let shapes = file.shapes();
        let [stn, fstn, trunk, front] = PARTS.map(|[convs, fcs]| Net {
            convs: numbered(&shapes, convs),
            fcs: numbered(&shapes, fcs),
        });
        let is_model = trunk.convs.len() >= 2 && !trunk.fcs.is_empty();
        ensure!(
            is_model,
            "{}: expected the layers of a PointNet; `infer-cpu inspect` shows those of a model",
            path.display()
        );
        Ok(Self { stn, fstn, trunk, transform_after: card.transform_after, front })
    }
}

/// The layers `prefix1`, `prefix2`, … as long as they go on.
fn numbered(shapes: &BTreeMap<String, Vec<usize>>, prefix: &str) -> Vec<Layer> {
    let layers = (1..).map_while(|number: usize| {
        match shapes.get(&format!("{prefix}{number}.weight")).map(Vec::as_slice) {
            Some(&[outputs, inputs] | &[outputs, inputs, 1]) => Some(Layer { inputs, outputs }),
            _ => None,
        }
    });
    layers.collect()
}

/// Writes a stand-in to `path`, calibrated for int8.
///
/// # Errors
/// What the system reports.
pub fn write_stand_in(path: &Path) -> anyhow::Result<()> {
    let mut tensors = BTreeMap::new();
    for (names, widths) in PARTS.iter().zip(WIDTHS) {
        for (name, widths) in names.iter().zip(widths) {
            for (i, pair) in widths.windows(2).enumerate() {
                let layer = Layer { inputs: pair[0], outputs: pair[1] };
                let name = format!("{name}{}", i + 1);
                // T-Nets predict nearly the identity, so that nothing overflows.
                let ends_t_net = name.contains("stn.fc") && i + 2 == widths.len();
                insert(&mut tensors, &name, layer, if ends_t_net { 0.01 } else { 1.0 });
                if ends_t_net {
                    add_identity(&mut tensors, &format!("{name}.bias"));
                }
            }
        }
    }
    let mut card = ModelCard {
        normalization: Normalization::UnitSphere,
        trained: false,
        ..ModelCard::from_metadata(path, &BTreeMap::new())?
    };
    write_weights(path, &tensors, &card.to_metadata())?;
    card.activation_ranges =
        infer_cpu::activation_ranges_by_rule(path).context("calibrating the stand-in for int8")?;
    Ok(write_weights(path, &tensors, &card.to_metadata())?)
}

/// Weights uniform with the variance that keeps activations' (He et al. 2015),
/// times `gain`.
fn insert(tensors: &mut BTreeMap<String, Tensor>, name: &str, layer: Layer, gain: f64) {
    let Layer { inputs, outputs } = layer;
    let key = StreamKey::new(0, name, 0);
    let bound = gain * (6.0 / inputs as f64).sqrt();
    let weight = |i: u64| (bound * (2.0 * key.unit(i) - 1.0)) as f32;
    let values = (0..(inputs * outputs) as u64).map(weight).collect();
    tensors.insert(format!("{name}.weight"), Tensor { shape: vec![outputs, inputs], values });
    let bias = Tensor { shape: vec![outputs], values: vec![0.0; outputs] };
    tensors.insert(format!("{name}.bias"), bias);
}

/// Adds the identity to the biases `name` of a layer that predicts a matrix.
fn add_identity(tensors: &mut BTreeMap<String, Tensor>, name: &str) {
    if let Some(bias) = tensors.get_mut(name) {
        let k = bias.values.len().isqrt();
        bias.values.iter_mut().step_by(k + 1).for_each(|value| *value += 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stand_in_is_the_baseline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stand-in.safetensors");
        write_stand_in(&path).unwrap();
        let network = Network::read(&path).unwrap();
        let widths = |layers: &[Layer]| {
            let outputs = layers.iter().map(|layer| layer.outputs);
            layers.iter().take(1).map(|layer| layer.inputs).chain(outputs).collect::<Vec<_>>()
        };
        let nets = [&network.stn, &network.fstn, &network.trunk, &network.front];
        for (net, [convs, fcs]) in nets.into_iter().zip(WIDTHS) {
            assert_eq!(widths(&net.convs), convs);
            assert_eq!(widths(&net.fcs), fcs);
        }
        let classifier = infer_cpu::Classifier::load(&path, &infer_cpu::Options::default());
        assert_eq!(classifier.unwrap().classes().len(), 40);
    }

    #[test]
    fn a_file_without_a_trunk_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.safetensors");
        write_weights(&path, &BTreeMap::new(), &BTreeMap::new()).unwrap();
        assert!(
            Network::read(&path)
                .unwrap_err()
                .to_string()
                .contains("expected the layers of a PointNet")
        );
    }
}
